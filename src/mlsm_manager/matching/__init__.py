"""Scan matching: where a scan lies in the map (thesis 6.3, 6.5.6)."""
