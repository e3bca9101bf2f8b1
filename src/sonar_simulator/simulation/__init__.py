"""World, vehicle and sonar simulated together over time; the vehicle's motion, odometry and servo."""
