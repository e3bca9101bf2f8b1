"""The maker's `.852` logs."""
