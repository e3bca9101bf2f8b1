"""Tells without any truth whether a run can be trusted."""
