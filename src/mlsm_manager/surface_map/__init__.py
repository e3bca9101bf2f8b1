"""The Multi Level Surface Map: its blocks, how points join them, how it is stored (thesis 6.2)."""
