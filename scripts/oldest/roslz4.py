"""Stands in for ROS's compiled LZ4, without which rosbag prints a warning; no unit test reads or writes LZ4."""
