"""Maps in the formats of other programs, and the folder that holds them."""
