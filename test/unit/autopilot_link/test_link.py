"""The link to an autopilot, over UDP on this machine."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from autopilot_peer import AHEAD_NS, Peer, quiet_health, wait_until
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from autopilot_link import link as link_module
from autopilot_link.link import AutopilotLink
from autopilot_link.messages import Reader
from autopilot_link.parameters import AutopilotLinkParameters, PoseMessage
from autopilot_link.protocol import StatedPose
from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix
from sonar_driver.port import PortRefusedError

LOCAL = "udpin:127.0.0.1:0"
POSE = StatedPose(
    10**18, pose_matrix((1.0, 2.0, -3.0), (0.0, 0.0, math.pi / 2)), np.array([0.5, 0.0, 0.0]), np.eye(6), 7
)
SENT = {"ODOMETRY", "VISION_POSITION_ESTIMATE", "TIMESYNC"}


@pytest.fixture
def opened(monkeypatch):
    """Return a function that opens a link, which is ready where it has peers; all are closed at the end."""
    monkeypatch.setattr(link_module, "_QUESTION_PERIOD", 0.05)
    open_ones = []

    def make(*peers, **values):
        health, messages = quiet_health(), []
        parameters = AutopilotLinkParameters(connection=LOCAL, **values)
        link = AutopilotLink(parameters, health, time.monotonic_ns, lambda *message: messages.append(message))
        open_ones.append(link)
        made = [Peer(link.name, **peer) for peer in peers]
        open_ones.extend(made)
        wait_until(lambda: not (peers and link.obstacle()))
        return (link, health, messages, *made)

    yield make
    for one in open_ones:
        one.close()


def _sent(link, peer, kind="ODOMETRY", pose=POSE):
    """Send a position and return it as the peer got it."""
    before = len(peer.of_type(kind))
    link.send(pose)
    wait_until(lambda: len(peer.of_type(kind)) > before)
    return peer.of_type(kind)[-1]


def test_a_position_arrives_in_the_autopilots_axes_and_time(opened):
    link, _, _, peer = opened({})
    stamp = time.monotonic_ns()
    got = _sent(link, peer, pose=replace(POSE, stamp_ns=stamp))
    np.testing.assert_allclose([got.x, got.y, got.z, *got.q], [2.0, 1.0, 3.0, 1.0, 0.0, 0.0, 0.0], atol=1e-6)
    assert (got.frame_id, got.child_frame_id) == (mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD)
    assert (got.vx, got.reset_counter) == (0.5, 7)
    # Half a round trip is the most that the offset may be off.
    assert abs(got.time_usec * 1000 - stamp - AHEAD_NS) < 0.5e9


def test_other_firmware_and_the_other_message(opened):
    link, _, _, peer = opened({"firmware": mavlink.MAV_AUTOPILOT_PX4})
    assert _sent(link, peer).frame_id == mavlink.MAV_FRAME_LOCAL_NED
    link, _, _, peer = opened({}, message=PoseMessage.VISION_POSITION_ESTIMATE)
    got = _sent(link, peer, "VISION_POSITION_ESTIMATE")
    np.testing.assert_allclose([got.x, got.y, got.z, got.roll, got.yaw], [2.0, 1.0, 3.0, 0.0, 0.0], atol=1e-6)


def test_nothing_is_sent_before_an_autopilot_is_heard_and_tells_its_time(opened):
    link, _, _ = opened()
    assert "no autopilot is heard" in link.obstacle()
    with pytest.raises(RefusedInput, match="no autopilot is heard"):
        link.send(POSE)


def test_nothing_but_positions_and_times_is_ever_sent(opened):
    link, _, _, peer = opened({})
    for message in (
        mavlink.MAVLink_command_long_message(1, 197, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_param_request_list_message(1, 197),
        mavlink.MAVLink_ping_message(0, 1, 0, 0),
        mavlink.MAVLink_timesync_message(0, 12345),
    ):
        peer.send(message)
    wait_until(lambda: any(message.ts1 == 12345 for message in peer.of_type("TIMESYNC")))
    (answer,) = [message for message in peer.of_type("TIMESYNC") if message.ts1 == 12345]
    # An autopilot that converts stamps finds that our clock is its own.
    assert abs(answer.tc1 - peer.now_ns()) < 10e9
    _sent(link, peer)
    assert {message.get_type() for message in peer.received} <= SENT
    assert {(message.get_srcSystem(), message.get_srcComponent()) for message in peer.received} == {(1, 197)}


def test_of_two_autopilots_on_one_link_only_the_chosen_one_gets_positions_and_is_read(opened):
    link, _, messages, first, second = opened({"system": 1}, {"system": 2}, system=2)
    for peer in (first, second):
        peer.send(mavlink.MAVLink_attitude_message(peer.now_ns() // 10**6, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0))
    _sent(link, second)
    wait_until(lambda: any(message.get_type() == "ATTITUDE" for message, _ in messages))
    assert {message.get_srcSystem() for message, _ in messages} == {2}
    assert first.of_type("ODOMETRY") == []


def test_a_second_autopilot_is_told_where_none_was_chosen(opened):
    link, health, _, _ = opened({"system": 1})
    other = Peer(link.name, system=2)
    wait_until(lambda: "heartbeats of other autopilots" in health.report().values)
    other.close()
    assert health.report().values["autopilot"] == "system 1, ARDUPILOT"


def test_a_lost_autopilot_is_told_and_comes_back_with_its_new_clock(opened, monkeypatch):
    monkeypatch.setattr(link_module, "LINK_LOST", 0.5)
    link, _, _, peer = opened({})
    peer.close()
    wait_until(lambda: "nothing of the autopilot" in link.obstacle())
    again = Peer(link.name, ahead_ns=-AHEAD_NS)
    wait_until(lambda: not link.obstacle())
    stamp = time.monotonic_ns()
    got = _sent(link, again, pose=replace(POSE, stamp_ns=stamp + 2 * AHEAD_NS))
    assert abs(got.time_usec * 1000 - stamp - AHEAD_NS) < 0.5e9
    again.close()


@given(st.lists(st.binary(max_size=300), max_size=5))
def test_no_bytes_end_the_reading(pieces):
    reader = Reader()
    for piece in pieces:
        reader.messages(piece, None)
    heartbeat = mavlink.MAVLink_heartbeat_message(12, 3, 0, 0, 0, 3).pack(mavlink.MAVLink(None, 1, 1))
    fresh = reader.messages(heartbeat, "another sender")
    assert [message.get_type() for message in fresh] == ["HEARTBEAT"]


@pytest.mark.parametrize("name", ["udpin:nowhere", "udpout:127.0.0.1:0", "udpout:127.0.0.1:70000"])
def test_a_name_that_is_no_connection_is_refused(name):
    with pytest.raises(PortRefusedError):
        AutopilotLink(AutopilotLinkParameters(connection=name), quiet_health(), time.monotonic_ns, lambda *_: None)
