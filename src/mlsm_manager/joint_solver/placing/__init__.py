"""Where the vehicle was, and where points lie, given the unknowns."""
