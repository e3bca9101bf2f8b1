"""From beams to clean clouds: projection, thresholding and outlier removal (thesis chapters 6.5.2 to 6.5.5)."""
