"""The servo that tilts the sonar."""
