"""Stages that take a cloud and return a cloud."""
