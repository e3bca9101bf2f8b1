"""What a recording may not tell."""

from dataclasses import dataclass

from sonar_processing.beams.mounting import MountingParameters
from sonar_processing.messages.parameters import BeamMessageParameters


@dataclass(frozen=True)
class ReadingParameters(MountingParameters, BeamMessageParameters):
    """Where the sonar is mounted, and how the angles in its messages are understood."""
