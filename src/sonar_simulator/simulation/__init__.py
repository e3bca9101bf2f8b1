"""World, vehicle and sonar simulated together over time."""
