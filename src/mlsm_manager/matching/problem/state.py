"""Names of the eight states that a match estimates; `scan_path` says what they mean."""

X, Y, YAW, RATE_X, RATE_Y, RATE_YAW, SCALE, DIRECTION = range(8)
STATES = 8

POSITION = slice(X, YAW)
"""x y [m] of base_link in map at the reference time."""

POSE = slice(X, RATE_X)
"""Position and yaw [rad]: T_map_base at the reference time."""

RATE_XY = slice(RATE_X, RATE_YAW)
"""Error of the odometry's speed in the vehicle's frame, m/s."""

RATE = slice(RATE_X, SCALE)
"""The same and the error of its turn rate, rad/s."""

MOTION = slice(SCALE, STATES)
"""Relative error of the odometry's distances, and error of their direction [rad]."""

ERRORS = slice(RATE_X, STATES)
"""All errors of the odometry."""
