"""What the drivers of all sonars share: the line, the ping loop, health, an emulated head's frame, and their nodes."""
