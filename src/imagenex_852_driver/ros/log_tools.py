"""The ROS side of .852 logs: plays them, records them, and converts them to bags."""

import math
import os
import threading
import time
from argparse import Namespace
from pathlib import Path
from typing import Optional

import rosbag
import rospy
from dynamic_reconfigure.encoding import decode_config
from dynamic_reconfigure.msg import Config

from imagenex_852_driver.logs import log_file
from imagenex_852_driver.logs.log_record import LoggedPing
from imagenex_852_driver.logs.playback import timed
from imagenex_852_driver.protocol.angles import head_position
from imagenex_852_driver.protocol.settings import HeadSettings
from imagenex_852_driver.ros.messages import logged_ping, scan_line
from node_support import topics
from node_support.errors import RefusedInput
from node_support.files import whole_file
from node_support.headers import check_stamp
from node_support.parameters import ParameterError
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.node import LAST_MESSAGES_ARRIVE, StartError
from underwater_map_construction.msg import SonarScanLine

_WAIT_STEP = 0.05  # s: soon enough for a person


class LogPlayer:
    """Publishes a log on sonar/raw, stamped with the current time, then ends the node."""

    def __init__(self, options: Namespace) -> None:
        """Raises StartError when the log cannot be read."""
        self._options = options
        self._reader = opened(options.file)
        self._published = 0
        self._health = make_health("play_852")
        self.healths = [self._health]
        self._publish = guarded(self._health, self._publish_ping)
        self._beams = rospy.Publisher(topics.BEAMS, SonarScanLine, queue_size=1000)
        self._ended = threading.Event()
        rospy.on_shutdown(self._end)
        threading.Thread(target=guarded(self._health, self._run), daemon=True).start()

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
        message = _message(ping, stamp, self._options)
        if message is not None:
            self._beams.publish(message)
            self._health.count("beams out")
            self._published += 1

    def _end(self) -> None:
        self._ended.set()
        print(f"play_852: {self._published} beams published; {summary(self._reader)}")


def convert(options: Namespace) -> str:
    """Write the bag of a log, whole or not at all; return in words what was written.

    Raises StartError when that cannot be done, and when the file holds no ping.
    """
    reader = opened(options.file)
    count, start = 0, options.start
    try:
        with whole_file(Path(options.out)) as temporary, rosbag.Bag(str(temporary), "w") as bag:
            for moment, ping in timed(reader, options.rate):
                if start is None:
                    start = ping.stamp or os.path.getmtime(options.file)
                message = _message(ping, start + moment, options)
                if message is not None:
                    bag.write(options.topic, message, message.header.stamp)
                    count += 1
            if not reader.ping_count:
                raise StartError(f"{options.file}: not a .852 log, no ping in it; nothing was written")
    except OSError as error:
        raise StartError(f"{options.out}: {error.strerror}") from error
    return f"{options.out}: {count} beams; {summary(reader)}"


class LogRecorder:
    """Appends the beams of sonar/raw to a log, with the settings of the driver as they change."""

    def __init__(self, options: Namespace) -> None:
        """Raises StartError when the log cannot be written."""
        self._health = make_health("record_852")
        self.healths = [self._health]
        self._driver = rospy.resolve_name(options.driver)
        self._settings = HeadSettings(head_id=rospy.get_param(f"{self._driver}/head_id", HeadSettings.head_id))
        self._inverted = False
        self._last_position: Optional[int] = None
        self._clockwise = True
        try:
            self._writer = log_file.LogWriter(options.file)
        except OSError as error:
            raise StartError(f"{options.file}: {error.strerror}") from error
        rospy.Subscriber(f"{self._driver}/parameter_updates", Config, guarded(self._health, self._take_settings))
        self._beams = rospy.Subscriber(
            topics.BEAMS, SonarScanLine, guarded(self._health, self._record), queue_size=1000
        )
        rospy.on_shutdown(self._end)

    def _take_settings(self, config: Config) -> None:
        values = decode_config(config)
        names = [field.name for field in HeadSettings.tunable_fields()]
        try:
            self._settings = self._settings.changed({name: values[name] for name in names if name in values})
        except ParameterError as error:
            self._health.problem("settings not understood", str(error))
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
        self._health.count("pings written")

    def _end(self) -> None:
        self._beams.unregister()
        self._writer.close()


def opened(path: str) -> log_file.LogReader:
    """Return the reader of a log; raises StartError if it cannot be read."""
    try:
        return log_file.read(path)
    except OSError as error:
        raise StartError(f"{path}: {error.strerror}") from error


def summary(reader: log_file.LogReader) -> str:
    """Return in words what the part of a log that was read contains."""
    damages = "; ".join(str(damage) for damage in reader.damages[:3])
    skipped = f", skipped {reader.damage_count} damaged parts: {damages}" if reader.damage_count else ""
    return f"{reader.ping_count} pings in the log{skipped}"


def _message(ping: LoggedPing, stamp: float, options: Namespace) -> Optional[SonarScanLine]:
    return scan_line(stamp, ping.reply, ping.start_gain_db, options.frame_id, options.inverted)
