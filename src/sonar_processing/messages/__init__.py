"""Messages of sonars, by type: plain attribute objects in, beams out."""
