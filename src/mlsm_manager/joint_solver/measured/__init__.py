"""What was measured during a run: surface points of all scans, the nodes' times and the odometry."""
