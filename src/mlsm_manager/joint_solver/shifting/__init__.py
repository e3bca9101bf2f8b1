"""Looks for better paths of a whole run by shifting all that follows some moment along the way that is known least."""
