"""Random messages of any type: sane ones with a few fields replaced by what no publisher should send."""

import math
import random
import time
from typing import Any, Callable, Dict

import genpy
import numpy as np
from geometry_msgs.msg import Quaternion
from messages import beam, transform
from rosgraph_msgs.msg import Clock
from roslib.message import get_message_class
from sensor_msgs.msg import Imu, JointState, LaserScan
from tf2_msgs.msg import TFMessage

from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import cloud_to_message
from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

FRAMES = ("odom", "map", "base_link", "sonar", "moon", "", "/sonar", "so\0nar", "a" * 3000, "\u00fc \n")
SECONDS = (0, 1, 10, 2**31 - 1, 2**31, 2**31 + 1, 2**32 - 1)
FLOATS = (0.0, -1.0, 1e-40, 1e6, 1e9, 1e30, 3.4e38, math.nan, math.inf, -math.inf)
FLOATS_64 = (1e38, -1e38, 1e300, 4294967295.9, 2.0**31)
DAY = 86400
_INTEGER_BITS = {"int8": 8, "int16": 16, "int32": 32, "int64": 64}


class RandomMessages:
    """Makes messages; the same seed makes the same ones, but for stamps, which are around the time it was made."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._start = time.time()
        self._sane: Dict[str, Callable[[], Any]] = {
            "underwater_map_construction/SonarScanLine": self._beam,
            "underwater_map_construction/StampedIntensityCloud": self._cloud,
            "sensor_msgs/PointCloud2": lambda: self._cloud().cloud,
            "sensor_msgs/LaserScan": self._laser_scan,
            "sensor_msgs/Imu": self._compass,
            "sensor_msgs/JointState": lambda: JointState(name=["sonar_servo_joint"], position=[self._float()]),
            "tf2_msgs/TFMessage": self._transforms,
        }

    def message(self, kind: str) -> Any:
        """Return a message of a type such as sensor_msgs/PointCloud2."""
        if kind == "rosgraph_msgs/Clock":
            return self._clock()
        make = self._sane.get(kind)
        if make is None or self._random.random() < 0.1:
            return self._filled(get_message_class(kind)())
        message = make()
        for _ in range(self._random.choice((0, 1, 1, 2, 4))):
            self.spoil(message)
        return message

    def spoil(self, message: genpy.Message) -> None:
        """Replace one field, however deep it lies."""
        name, kind = self._random.choice(list(zip(message.__slots__, message._slot_types)))
        value = getattr(message, name)
        if isinstance(value, genpy.Message):
            self.spoil(value)
        elif isinstance(value, list) and value and isinstance(value[0], genpy.Message):
            if self._random.random() < 0.8:
                self.spoil(self._random.choice(value))
            else:
                setattr(message, name, value * self._random.choice((0, 2, 20)))
        else:
            setattr(message, name, self._value(kind))

    def _filled(self, message: genpy.Message) -> genpy.Message:
        for name, kind in zip(message.__slots__, message._slot_types):
            setattr(message, name, self._value(kind))
        return message

    def _value(self, kind: str) -> Any:
        base, is_array, size = kind.partition("[")
        if is_array:
            return self._array(base, size.rstrip("]"))
        if base == "time":
            return self.stamp()
        if base == "duration":
            return genpy.Duration(self._random.choice((-(2**31), -1, 0, 2**31 - 1)), 0)
        if base == "string":
            return self._random.choice(FRAMES)
        if base.startswith("float"):
            return self._float(base == "float64")
        if base == "bool":
            return self._random.random() < 0.5
        if "/" not in base and base != "Header":
            return self._integer({"byte": "int8", "char": "uint8"}.get(base, base))
        return self._filled(get_message_class({"Header": "std_msgs/Header"}.get(base, base))())

    def _array(self, base: str, size: str) -> Any:
        count = int(size) if size else self._random.choice((0, 0, 1, 2, 7, 50))
        if base in ("uint8", "char"):
            length = count if size else count * 100
            return self._random.getrandbits(8 * length + 8).to_bytes(length + 1, "little")[:length]
        values = [self._value(base) for _ in range(count)]
        return np.array(values, dtype=base) if base.startswith("float") and not size else values

    def _integer(self, kind: str) -> int:
        bits = _INTEGER_BITS[kind.lstrip("u")]
        low, high = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return self._random.choice((low, high, 0, 1, 16, high // 2, self._random.randint(low, high)))

    def _float(self, is_wide: bool = False) -> float:
        ordinary = self._random.uniform(-10.0, 10.0)
        return self._random.choice((*FLOATS, *(FLOATS_64 if is_wide else ()), ordinary, ordinary))

    def stamp(self) -> genpy.Time:
        """Return a stamp: mostly around now, else from the whole range, not always with less than 1e9 nanoseconds."""
        near = int(self._start + self._random.uniform(-60.0, 60.0))
        days = int(self._start + self._random.choice((-1000, -2, -0.5, 0.5, 2, 1000)) * DAY)
        seconds = self._random.choice((near, near, days, *SECONDS, self._random.getrandbits(32)))
        stamp = genpy.Time(seconds, self._random.choice((0, 1, 900_000_000, 999_999_999)))
        if self._random.random() < 0.05:
            stamp.nsecs = 2**32 - 1
        return stamp

    def _clock(self) -> Clock:
        """Return any time that rospy can put into a message again: with too many nanoseconds it cannot."""
        stamp = self.stamp()
        return Clock(genpy.Time(stamp.secs, min(stamp.nsecs, 999_999_999)))

    def _beam(self) -> SonarScanLine:
        angle = self._random.uniform(-4.0, 4.0)
        return beam(time.time(), angle, bytes(self._random.choice((3, 120)) for _ in range(50)))

    def _cloud(self) -> StampedIntensityCloud:
        now, count = time.time(), self._random.choice((0, 2, 60))
        points = np.array([[self._random.uniform(-20.0, 20.0) for _ in range(4)] for _ in range(count)]).reshape(-1, 4)
        if count and self._random.random() < 0.5:
            points[self._random.randrange(count), self._random.randrange(4)] = self._float()
        stamps = np.full(count, self._random.choice((-now, now)))
        height = self._random.choice((1, 2)) if count else 1
        cloud = Cloud(points.astype(np.float32), stamps, int(now * 1e9), "odom", height)
        return cloud_to_message(cloud)

    def _laser_scan(self) -> LaserScan:
        scan = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=math.pi / 90.0, range_max=50.0)
        scan.header.stamp, scan.header.frame_id = genpy.Time.from_sec(time.time()), "sonar"
        scan.ranges = [self._random.uniform(0.5, 49.0) for _ in range(181)]
        return scan

    def _compass(self) -> Imu:
        heading = self._random.uniform(-math.pi, math.pi)
        compass = Imu(orientation=Quaternion(z=math.sin(heading / 2.0), w=math.cos(heading / 2.0)))
        compass.header.stamp, compass.header.frame_id = genpy.Time.from_sec(time.time()), "base_link"
        return compass

    def _transforms(self) -> TFMessage:
        pairs = [self._random.choices(FRAMES[:5], k=2) for _ in range(self._random.choice((1, 1, 3)))]
        return TFMessage([transform(*frames, seconds=time.time()) for frames in pairs])
