"""The Ping360 as the nodes of drivers and emulated heads know it, and its messages."""
