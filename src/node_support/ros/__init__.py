"""What every node shares: start, guarded callbacks, diagnostics, reconfiguration, conversions."""
