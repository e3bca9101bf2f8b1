"""Driver of the Blue Robotics Ping360 scanning sonar: protocol, line and an emulated head."""
