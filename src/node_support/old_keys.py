"""Keys of parameters in yaml files of older versions: their names, or what happened to them."""

RENAMED = {
    "block_scans": "scans_per_group",
    "heading_time": "heading_correlation_time",
    "lone_quality": "post_confidence",
    "motion_time": "motion_correlation_time",
    "rate_time": "rate_correlation_time",
    "save_folder": "map_directory",
    "scan_parts": "parts_per_turn",
    "slip_time": "slip_correlation_time",
    "turn_rate_time": "turn_rate_correlation_time",
}
"""Names of parameters by their older ones."""

GONE = {
    "edge_half_width": "edges of beams are not matched",
    "gicp_distance": "GICP is compared with by scripts/results",
    "insertion": "the loops are always compiled",
    "kernel": "the loops are always compiled",
    "matcher": "estimator: THESIS chooses the thesis's matching",
    "solver_kernel": "the loops are always compiled",
}
"""Keys without effect, and why."""
