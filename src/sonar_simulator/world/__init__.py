"""The world around the sonar: files, shapes, materials."""
