"""What each kind of odometry says of the vehicle's motion, and how wrong it may be."""
