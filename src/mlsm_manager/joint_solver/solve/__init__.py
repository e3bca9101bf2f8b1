"""The solvers: live, scan by scan, and in batch, over the whole run."""
