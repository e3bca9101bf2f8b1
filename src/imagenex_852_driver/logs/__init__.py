"""The manufacturer's `.852` logs."""
