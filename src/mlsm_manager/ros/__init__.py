"""Nodes, topics, bags and services of the map."""
