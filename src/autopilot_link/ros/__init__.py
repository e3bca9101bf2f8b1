"""The node autopilot_link."""
