"""Fits the vehicle's path, the odometry's errors and the sonar's calibration to many scans at once."""
