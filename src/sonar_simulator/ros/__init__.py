"""Nodes, messages and bags of the simulator."""
