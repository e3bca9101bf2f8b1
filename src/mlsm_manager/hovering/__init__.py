"""For vehicles that stop and strafe with a compass alone: a particle filter, and afterwards a search over paths."""
