"""Dead reckoning of a vehicle without a DVL, from heading, depth and a velocity that others estimate or command."""
