"""Beams of a recording, from bags and from the logs of sonars' makers."""
