"""Maps as files: written whole or not at all, checked when read, kept under names of their own."""
