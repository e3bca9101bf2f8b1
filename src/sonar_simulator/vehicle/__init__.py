"""The simulated vehicle: movement, odometry, servo, description."""
