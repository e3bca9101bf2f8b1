"""Multi Level Surface Maps: building, showing and storing them (thesis chapters 6.2 and 6.5.6)."""
