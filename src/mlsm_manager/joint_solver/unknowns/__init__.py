"""The unknowns of the joint solver: their names, the equations for them, how they go on from node to node."""
