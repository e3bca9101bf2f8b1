"""Damaged files of every kind that is read, and the programs that read them."""
