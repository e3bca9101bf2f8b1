"""What is matched: a scan, its path, what is known beforehand, and the result."""
