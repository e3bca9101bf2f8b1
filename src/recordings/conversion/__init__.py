"""Recordings of any kind as bags of ROS 1."""
