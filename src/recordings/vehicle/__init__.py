"""What a recording tells of its vehicle's motion."""
