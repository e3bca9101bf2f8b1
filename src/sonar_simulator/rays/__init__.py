"""Rays, the surfaces they meet and mirrors."""
