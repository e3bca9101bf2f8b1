"""Nodes, topics and messages of the processing."""
