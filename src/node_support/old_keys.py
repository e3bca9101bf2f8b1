"""Parameters in yaml files of older versions: their names and values of today, or what happened to them."""

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

_LIMITS = "a single scan is searched, and judged, within fixed limits"

GONE = {
    "candidates": _LIMITS,
    "edge_half_width": "edges of beams are not matched",
    "gicp_distance": "GICP is compared with by scripts/results",
    "insertion": "the loops are always compiled",
    "kernel": "the loops are always compiled",
    "matcher": "estimator: THESIS chooses the thesis's matching",
    "max_jump": _LIMITS,
    "max_position_deviation": _LIMITS,
    "max_steps": _LIMITS,
    "max_yaw_deviation": _LIMITS,
    "min_agreement": _LIMITS,
    "min_gain_over_second": _LIMITS,
    "min_points": _LIMITS,
    "min_significance": _LIMITS,
    "search_angle": _LIMITS,
    "search_cell": _LIMITS,
    "search_distance": _LIMITS,
    "solver_kernel": "the loops are always compiled",
}
"""Keys without effect, and why."""

OLD_VALUES = {("estimator", "SCAN_BY_SCAN"): "JOINT"}
"""Values of today by key and older value."""
