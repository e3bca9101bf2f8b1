"""What every node of this package shares: validated parameters, health counters, guarded callbacks."""
