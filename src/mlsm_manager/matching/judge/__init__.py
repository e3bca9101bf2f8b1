"""Checks of whether a fit can be trusted."""
