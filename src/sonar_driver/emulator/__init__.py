"""What emulated heads of all sonars share: the served line, faults, and where echoes come from."""
