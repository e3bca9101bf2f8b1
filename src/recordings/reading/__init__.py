"""Recordings of any kind, read whole."""
