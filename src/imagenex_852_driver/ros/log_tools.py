"""The ROS side of .852 logs: plays and records them."""

import math
import threading
import time
from argparse import Namespace
from dataclasses import replace
from typing import Optional

import rospy
from dynamic_reconfigure.encoding import decode_config
from dynamic_reconfigure.msg import Config
from rosgraph.names import anonymous_name

from imagenex_852_driver.log_file import LoggedPing, LogReader, LogWriter, timed
from imagenex_852_driver.parameters import HeadSettings
from imagenex_852_driver.reply import Reply, ReplyKind, head_position
from imagenex_852_driver.ros.nodes import reply_message
from node_support import topics
from node_support.errors import RefusedInput
from node_support.headers import check_stamp
from node_support.help import CommandLine, positive
from node_support.parameters import ParameterError
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.node import LAST_MESSAGES_ARRIVE, StartError, run
from underwater_map_construction.msg import SonarScanLine

_KINDS = {kind.echo_count: kind for kind in ReplyKind if kind.echo_count}
_WAIT_STEP = 0.05  # s: soon enough for a person


def run_player() -> None:
    """Publish a log, then end; several may play at once. Exits on a bad command line."""
    parser = CommandLine("play_852", description="Publish the pings of a .852 log on sonar/raw.")
    parser.add_argument("file", help="log to play")
    parser.add_argument("--rate", type=positive, help="pings per second (default: as logged, or 10 without times)")
    parser.add_argument("--loop", action="store_true", help="start again at the end")
    parser.add_argument("--wait-for-subscribers", action="store_true", help="start when somebody subscribes")
    parser.add_argument("--frame-id", default="sonar", help="frame of the head")
    parser.add_argument("--inverted", action="store_true", help="the head was mounted upside down")
    options = parser.parse_args(rospy.myargv()[1:])
    run(anonymous_name("play_852"), lambda: LogPlayer(options))


def run_recorder() -> None:
    """Record until the node ends; exits on a bad command line."""
    parser = CommandLine("record_852", description="Append the beams of sonar/raw to a .852 log.")
    parser.add_argument("file", help="log to append to")
    parser.add_argument("--driver", default="imagenex_852_driver", help="node whose settings go into the log")
    options = parser.parse_args(rospy.myargv()[1:])
    run("record_852", lambda: LogRecorder(options))


class LogPlayer:
    """Publishes a log on sonar/raw, stamped with the current time, then ends the node."""

    def __init__(self, options: Namespace) -> None:
        """Raises StartError when the log cannot be read."""
        self._options = options
        self._reader = opened(options.file)
        self._published = 0
        self.health = make_health("play_852")
        self._publish = guarded(self.health, self._publish_ping)
        self._beams = rospy.Publisher(topics.BEAMS, SonarScanLine, queue_size=1000)
        self._ended = threading.Event()
        rospy.on_shutdown(self._end)
        threading.Thread(target=guarded(self.health, self._run), daemon=True).start()

    def _run(self) -> None:
        try:
            self._play_to_the_end()
        except StartError as error:
            rospy.logfatal("%s: %s", rospy.get_name(), error)
        rospy.signal_shutdown("the log has ended")

    def _play_to_the_end(self) -> None:
        """Play once, or with `loop` until the node ends; a log without pings is played once."""
        while self._options.wait_for_subscribers and not self._beams.get_num_connections():
            if self._ended.wait(_WAIT_STEP):
                return
        self._play()
        while self._options.loop and self._published and not self._ended.is_set():
            self._reader = opened(self._options.file)
            self._play()
        self._ended.wait(LAST_MESSAGES_ARRIVE)

    def _play(self) -> None:
        start = time.monotonic()
        for moment, ping in timed(self._reader, self._options.rate):
            if self._ended.wait(max(start + moment - time.monotonic(), 0.0)):
                return
            self._publish(ping)

    def _publish_ping(self, ping: LoggedPing) -> None:
        stamp = rospy.get_time()
        check_stamp(round(stamp * 1e9))
        message = reply_message(ping.reply, ping.start_gain_db, self._options.inverted)
        if message is not None:
            message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp), self._options.frame_id
            self._beams.publish(message)
            self.health.count("beams out")
            self._published += 1

    def _end(self) -> None:
        self._ended.set()
        damages = self._reader.damages
        told = "; ".join(str(damage) for damage in damages[:3])
        skipped = f", skipped {len(damages)} damaged parts: {told}" if damages else ""
        print(f"play_852: {self._published} beams published; {self._reader.ping_count} pings in the log{skipped}")


class LogRecorder:
    """Appends the beams of sonar/raw to a log, with the settings of the driver as they change."""

    def __init__(self, options: Namespace) -> None:
        """Raises StartError when the log cannot be written."""
        self.health = make_health("record_852")
        self._driver = rospy.resolve_name(options.driver)
        self._settings = HeadSettings(head_id=rospy.get_param(f"{self._driver}/head_id", HeadSettings.head_id))
        self._inverted = False
        self._last_position: Optional[int] = None
        self._clockwise = True
        try:
            self._writer = LogWriter(options.file)
        except OSError as error:
            raise StartError(f"{options.file}: {error.strerror}") from error
        rospy.Subscriber(f"{self._driver}/parameter_updates", Config, guarded(self.health, self._take_settings))
        self._beams = rospy.Subscriber(topics.BEAMS, SonarScanLine, guarded(self.health, self._record), queue_size=1000)
        rospy.on_shutdown(self._end)

    def _take_settings(self, config: Config) -> None:
        values = decode_config(config)
        names = [field.name for field in HeadSettings.tunable_fields()]
        try:
            self._settings = self._settings.changed({name: values[name] for name in names if name in values})
        except ParameterError as error:
            self.health.problem("settings not understood", str(error))
        self._inverted = bool(values.get("inverted", False))

    def _record(self, message: SonarScanLine) -> None:
        check_stamp(message.header.stamp.to_nsec())
        if not (math.isfinite(message.angle) and math.isfinite(message.maxrange_meters)):
            detail = f"angle {message.angle} rad, maxrange_meters {message.maxrange_meters}, must be finite"
            raise RefusedInput("beams refused", detail)
        position = head_position(message.angle, self._inverted)
        if self._last_position not in (None, position):
            # The head may have passed straight astern, where positions wrap around.
            self._clockwise = 0 < (position - self._last_position) % 2400 < 1200
        self._last_position = position
        self._writer.write(logged_ping(message, self._settings, self._inverted, self._clockwise))
        self.health.count("pings written")

    def _end(self) -> None:
        self._beams.unregister()
        self._writer.close()


def logged_ping(
    message: SonarScanLine, settings: HeadSettings, inverted: bool = False, clockwise: bool = True
) -> LoggedPing:
    """Return the log's form of a message, with the settings that the message does not contain.

    Raises RefusedInput for a message that a head of this kind cannot have sent.
    """
    kind = _KINDS.get(len(message.intensities))
    if kind is None:
        counts = " or ".join(str(count) for count in _KINDS)
        raise RefusedInput("beams refused", f"{len(message.intensities)} intensities, a log takes {counts}")
    try:
        reply = Reply(
            kind,
            max_range=round(message.maxrange_meters),
            echoes=bytes(message.intensities),
            head_id=settings.head_id,
            head_position=head_position(message.angle, inverted),
            clockwise=clockwise,
        )
    except ValueError as error:
        raise RefusedInput("beams refused", str(error)) from error
    return replace(LoggedPing.of(message.header.stamp.to_sec(), settings.command(), reply), start_gain_db=message.gain)


def opened(path: str) -> LogReader:
    """Return the reader of a log; raises StartError if it cannot be read."""
    try:
        return LogReader(path)
    except OSError as error:
        raise StartError(f"{path}: {error.strerror}") from error
