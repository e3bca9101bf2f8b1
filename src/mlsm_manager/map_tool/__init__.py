"""map_tool: looks at, exports, crops, merges and compares maps."""
