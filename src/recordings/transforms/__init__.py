"""Where frames are in each other at any time, without tf2."""
