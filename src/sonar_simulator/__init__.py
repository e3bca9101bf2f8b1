"""Simulated sonar: world, rays, echo models, vehicle and odometry (thesis 6.4)."""
