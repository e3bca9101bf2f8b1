"""Search for places and motions that the solver's own steps do not reach."""
