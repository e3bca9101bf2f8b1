"""How old a position is when an emulated autopilot gets it: demo.launch in real time, autopilot_link, UDP.

The age of a position is the time from the beam, at whose stamp the vehicle has it, to its arrival. That of a fix is the
time from the last beam of its scan to the arrival of the first position that has it.
"""

import time
from pathlib import Path
from typing import Any, List, NamedTuple, Optional, Tuple

import numpy as np
from matplotlib.figure import Figure

from benchmarks.harness import Row, say
from benchmarks.programs import free_port, running, wait_for_graph, wait_until

_WANTED = "<= 150 ms at 95 %"
_GAP = 1.0  # s from a position on either side: what lies between is drawn as not sent


def rows(seconds: float = 60.0, picture: Optional[Path] = None) -> List[Row]:
    """Return the rows of a run of so many seconds after the first position; picture: where to draw it, a PNG."""
    with running() as programs:
        connection = f"udpin:127.0.0.1:{free_port()}"
        programs.demo("odometry_error:=0.3")
        programs.launch("autopilot_link.launch", f"connection:={connection}")
        import rospy
        from autopilot_peer import Peer
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from nav_msgs.msg import Odometry

        from underwater_map_construction.msg import PositionStatus

        wait_for_graph()
        rospy.init_node("autopilot_bench", anonymous=True, disable_signals=True)
        odometry, truth = _arrivals("/odom", Odometry), _arrivals("/ground_truth", Odometry)
        fixes = _arrivals("/MLSM/pose", PoseWithCovarianceStamped)
        doubts: List[str] = []
        rospy.Subscriber("/MLSM/status", PositionStatus, lambda one: doubts.extend([one.text] if one.state else []))
        peer = Peer(connection, clock=lambda: rospy.get_rostime().to_nsec())
        say("the vehicle dives; nothing is sent before seven fixes agree: about two minutes")
        wait_until(lambda: peer.of_type("ODOMETRY"), "a position")
        say(f"positions come: measuring for {seconds:g} s")
        doubts.clear()
        time.sleep(seconds)
        peer.close()
    run = Run(_sent(peer), *map(np.array, (odometry, truth, fixes)))
    if picture is not None:
        _draw(run).savefig(picture, dpi=90)
    if doubts:
        say(f"not sent in {len(doubts)} s; the last doubt: {doubts[-1]}")
    return _rows(run)


def _arrivals(topic: str, kind: type) -> List[Tuple[float, float, float, float]]:
    """Return a list that grows with each message of a topic.

    Rows are stamps [s], arrivals by this machine's clock [s], x and y [m] of the vehicle.
    """
    import rospy

    rows = []

    def take(message: Any) -> None:
        place = message.pose.pose.position
        rows.append((message.header.stamp.to_sec(), time.monotonic(), place.x, place.y))

    rospy.Subscriber(topic, kind, take, queue_size=1000, tcp_nodelay=True)
    return rows


class Run(NamedTuple):
    """Tables (n, 4) as those of _arrivals.

    sent: what the autopilot got, x east and y north; two more columns are the stated deviation [m] and the reset
    counter.
    """

    sent: np.ndarray
    odometry: np.ndarray
    truth: np.ndarray
    fixes: np.ndarray


def _sent(peer: Any) -> np.ndarray:
    rows = [
        (one.time_usec * 1e-6 - peer.ahead_ns * 1e-9, at, one.y, one.x,
         np.sqrt(one.pose_covariance[0] + one.pose_covariance[6]), one.reset_counter)
        for at, one in zip(peer.arrivals, peer.received) if one.get_type() == "ODOMETRY"
    ]  # fmt: skip
    return np.array(rows)


def _rows(run: Run) -> List[Row]:
    arrived, fixes = run.sent[:, 1], run.fixes[run.fixes[:, 1] > run.sent[0, 1]]
    following = np.searchsorted(arrived, fixes[:, 1])
    known = following < len(arrived)
    ages = arrived - _moments(run.sent[:, 0], run.odometry)
    fix_ages = arrived[following[known]] - _moments(fixes[known, 0], run.odometry)
    errors = _errors(run)
    return [
        (f"age of {len(ages)} positions on arrival, median and 95 %", _told(ages), _WANTED),
        (f"age of {len(fix_ages)} fixes on arrival, median and 95 %", _told(fix_ages), "as the solver needs"),
        ("positions a second", f"{(len(arrived) - 1) / np.ptp(arrived):.1f}", "10"),
        ("longest time without a position", f"{np.diff([*arrived, run.odometry[-1, 1]]).max():.1f} s", ""),
        ("off the truth, mean and most", f"{errors.mean():.2f} and {errors.max():.2f} m", ""),
        ("within two stated deviations", f"{100.0 * (errors < 2.0 * run.sent[:, 4]).mean():.0f} %", ""),
    ]


def _errors(run: Run) -> np.ndarray:
    """Return how far (n,) [m] what was sent is from the truth."""
    times, _, *truth = run.truth.T
    return np.hypot(*(run.sent[:, 2 + axis] - np.interp(run.sent[:, 0], times, truth[axis]) for axis in (0, 1)))


def _draw(run: Run) -> Figure:
    """Return the ways from above, and over time how far what was sent is from the truth."""
    figure = Figure(figsize=(11.0, 4.2), tight_layout=True)
    above, course = figure.subplots(1, 2, gridspec_kw={"width_ratios": (3, 2)})
    for table, color, style, name in (
        (run.odometry, "0.6", "-", "odometry, 30 % off"),
        (run.truth, "black", ":", "where the vehicle was"),
        (run.sent, "tab:green", "-", "sent to the autopilot"),
    ):
        above.plot(table[:, 2], table[:, 3], style, color=color, label=name)
    above.plot(run.fixes[:, 2], run.fixes[:, 3], "o", mfc="white", mec="tab:pink", ms=5, label="fixes")
    above.set(xlabel="east [m]", ylabel="north [m]", aspect="equal", adjustable="datalim")
    times, moments = (table[:, 0] - run.odometry[0, 0] for table in (run.sent, run.odometry))
    is_sent = np.diff(np.searchsorted(times, [moments - _GAP, moments + _GAP]), axis=0)[0] > 0
    course.plot(times, 2.0 * run.sent[:, 4], color="tab:pink", label="two stated deviations")
    course.plot(times, _errors(run), color="tab:green", label="off the truth")
    jumps = times[1:][np.diff(run.sent[:, 5]) != 0.0]
    if jumps.size:
        course.vlines(jumps, 0.0, run.sent[:, 4].max(), color="0.3", ls="--", label="reset_counter goes up")
    top = 1.05 * 2.0 * run.sent[:, 4].max()
    course.fill_between(moments, 0.0, top, where=~is_sent, color="0.93", label="not good: nothing is sent")
    course.set(xlabel="time [s]", ylabel="[m]", xlim=(0.0, moments[-1]), ylim=(0.0, top))
    above.legend(fontsize=8)
    course.legend(fontsize=8)
    return figure


def _moments(stamps: np.ndarray, odometry: np.ndarray) -> np.ndarray:
    """Return when the simulated moments (n,) s were, by this machine's clock: simulated time goes in steps."""
    nearest = np.abs(stamps[:, np.newaxis] - odometry[:, 0]).argmin(axis=1)
    return odometry[nearest, 1]


def _told(seconds: np.ndarray) -> str:
    return " and ".join(f"{round(1e3 * value)} ms" for value in np.percentile(seconds, [50.0, 95.0]))
