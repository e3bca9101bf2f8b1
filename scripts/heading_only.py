"""Copies a recording and leaves nothing of the odometry but heading, tilt and depth."""

import argparse
import sys
from pathlib import Path
from typing import Any, Optional

import rosbag

_VELOCITIES = ("geometry_msgs/Twist", "geometry_msgs/TwistStamped", "geometry_msgs/TwistWithCovarianceStamped")


def main() -> None:
    """Run with the command line; ends with one line and status 1 when the input cannot be read."""
    parser = argparse.ArgumentParser("heading_only", description=__doc__)
    parser.add_argument("input", type=Path, metavar="IN.bag")
    parser.add_argument("output", type=Path, metavar="OUT.bag")
    parser.add_argument("--odom-frame", default="odom", help="frame of the dead reckoning (default: %(default)s)")
    parser.add_argument("--base-frame", default="base_link", help="frame of the vehicle (default: %(default)s)")
    options = parser.parse_args()
    if options.input.resolve() == options.output.resolve():
        parser.error("IN.bag and OUT.bag must differ")
    try:
        reduce_bag(options.input, options.output, options.odom_frame, options.base_frame)
    except (OSError, rosbag.ROSBagException) as error:
        sys.exit(f"heading_only: {options.input}: {error}")


def reduce_bag(source: Path, target: Path, odom_frame: str, base_frame: str) -> None:
    """Write `target`; messages in other frames, such as a true position, stay as they are."""
    kept = []
    with rosbag.Bag(str(source)) as read:
        # Topics often lie in chunks of their own, and rosbag keeps one decompressed chunk.
        for topic in read.get_type_and_topic_info().topics:
            for _, message, time in read.read_messages(topics=[topic]):
                kept.append((time, topic, reduced(message, odom_frame, base_frame)))
    with rosbag.Bag(str(target), "w", compression="bz2") as written:
        for time, topic, message in sorted(kept, key=lambda entry: entry[0]):
            if message is not None:
                written.write(topic, message, time)


def reduced(message: Any, odom_frame: str, base_frame: str) -> Optional[Any]:
    """Return a message without what the vehicle's position and velocity were; None where nothing is left."""
    if message._type in _VELOCITIES:
        return None
    if message._type == "tf2_msgs/TFMessage":
        for transform in message.transforms:
            frames = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
            if frames == (odom_frame, base_frame):
                _forget(transform.transform.translation)
    if message._type == "nav_msgs/Odometry" and message.header.frame_id.lstrip("/") == odom_frame:
        _forget(message.pose.pose.position)
        _forget(message.twist.twist.linear)
    return message


def _forget(vector: Any) -> None:
    vector.x = vector.y = 0.0


if __name__ == "__main__":
    main()
