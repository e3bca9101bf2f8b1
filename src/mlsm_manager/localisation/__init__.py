"""Scans to a map and a correction of the odometry: what the live node and the tools on recordings share."""
