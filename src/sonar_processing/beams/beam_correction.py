"""Corrects the stamps and ranges of beams."""

from dataclasses import dataclass, replace

from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.beam import Beam


@dataclass(frozen=True)
class BeamCorrection(ParameterSet):
    """Known errors of a sonar's stamps and ranges; map_bag estimates both from a recording."""

    sonar_delay: float = parameter(
        0.0, "added to the stamps of beams to match those of the odometry", unit="s", low=-10.0, high=10.0,
        tunable=False,
    )  # fmt: skip
    range_scale: float = parameter(
        1.0, "true range divided by reported range; differs from 1 where the speed of sound does", low=0.5, high=2.0,
        tunable=False,
    )  # fmt: skip

    def corrected(self, beam: Beam) -> Beam:
        """Return the corrected beam; raises RefusedInput when its stamp would be below 0."""
        return replace(
            beam,
            stamp_ns=beam.stamp_ns + round(self.sonar_delay * 1e9),
            range_resolution=beam.range_resolution * self.range_scale,
        )
