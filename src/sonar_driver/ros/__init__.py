"""Nodes of drivers and of emulated heads."""
