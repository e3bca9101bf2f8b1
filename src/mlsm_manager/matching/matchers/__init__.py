"""The matchers, their table and their parameters."""
