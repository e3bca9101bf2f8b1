"""From rays to echo strengths: rays, what they meet, and echo models."""
