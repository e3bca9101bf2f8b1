"""The logs of Ping Viewer, the manufacturer's program."""
