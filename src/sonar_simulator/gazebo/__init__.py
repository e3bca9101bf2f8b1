"""Sonar beams from the rays of a sensor in Gazebo."""
