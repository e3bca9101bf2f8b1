"""The serial line: port, device, waiting for replies, the loop of pings."""
