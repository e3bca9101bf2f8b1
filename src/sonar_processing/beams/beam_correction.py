"""Puts right what a sonar says of every beam: when it was sent, and how far its echoes are."""

from dataclasses import dataclass, replace

from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.beam import Beam


@dataclass(frozen=True)
class BeamCorrection(ParameterSet):
    """What is known to be wrong with a sonar's stamps and ranges; map_bag estimates both from a recording."""

    sonar_delay: float = parameter(
        0.0, "what to add to the beams' stamps so that they agree with the odometry's", unit="s", low=-10.0, high=10.0,
        tunable=False,
    )  # fmt: skip
    range_scale: float = parameter(
        1.0, "true range over the range that the sonar reports, as of another speed of sound", low=0.5, high=2.0,
        tunable=False,
    )  # fmt: skip

    def corrected(self, beam: Beam) -> Beam:
        """Return the beam as it was; raises RefusedInput when it would have been sent before time 0."""
        return replace(
            beam,
            stamp_ns=beam.stamp_ns + round(self.sonar_delay * 1e9),
            range_resolution=beam.range_resolution * self.range_scale,
        )
