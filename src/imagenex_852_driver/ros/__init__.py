"""Nodes and messages of the driver, the emulator and the log tools."""
