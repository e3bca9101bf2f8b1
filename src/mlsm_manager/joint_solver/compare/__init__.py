"""Compares points with the surfaces that other scans heard."""
