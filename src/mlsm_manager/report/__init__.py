"""report.html: what a mission was, for people without ROS. One file that opens anywhere without a network."""
