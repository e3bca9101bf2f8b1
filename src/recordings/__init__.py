"""Recordings of any kind as the cores take them: beams, poses and times, without ROS."""
