"""World, vehicle and sonar on one time line."""
