"""Fit of a pose and its covariance."""
