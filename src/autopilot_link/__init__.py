"""Sends the position to an autopilot by MAVLink, and reads its heading, depth and velocity."""
