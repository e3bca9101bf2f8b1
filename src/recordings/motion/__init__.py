"""Where frames, and the vehicle, were at any time; without tf2."""
