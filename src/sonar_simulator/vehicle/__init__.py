"""The simulated vehicle: motion, odometry, servo and robot description."""
