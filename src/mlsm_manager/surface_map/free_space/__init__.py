"""Space that beams crossed before their first echo (thesis 6.2.1, type FREE), and what they say against blocks."""
