"""ROS nodes that work on recordings."""
