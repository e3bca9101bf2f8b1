"""Many ways that a vehicle may have gone, drawn at random and weighed by what it heard (a particle filter)."""
