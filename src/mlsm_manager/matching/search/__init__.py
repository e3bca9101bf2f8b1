"""Search for the poses at which a fit may start."""
