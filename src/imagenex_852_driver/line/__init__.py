"""The serial line: port, device, waiting for replies, and the ping loop."""
