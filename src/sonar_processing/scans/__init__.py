"""Beams together: scans, revolutions of the head, pictures."""
