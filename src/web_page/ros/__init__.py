"""The ROS side of web_page."""
