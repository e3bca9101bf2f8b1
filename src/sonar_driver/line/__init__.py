"""The line to a sonar: ports, reconnecting, the ping loop, and what is counted."""
