"""Where the rays of beams hit surfaces: the output of ray casters and the input of echo models."""

from dataclasses import dataclass
from typing import Optional, Sequence, Tuple

import numpy as np

from sonar_simulator.world.materials import DEFAULT_MATERIAL, Material


@dataclass(frozen=True)
class Contacts:
    """The contacts of a batch of beams, one column per ray; every array is (beams, contacts) unless said otherwise.

    ranges: m along the sound's path, inf where a ray hits nothing.
    cosines: of the angle between ray and surface normal, 0 to 1.
    material: index into `materials`; arbitrary where nothing is hit.
    directions: (beams, contacts, 3) unit vectors in the frame of the beam: x along its axis, z up.
    shares: share of the beam that a ray represents; the shares of a beam sum to about 1.
    losses: share of the intensity left after mirrors on the way, 0 to 1; 1 without a mirror.
    """

    ranges: np.ndarray
    cosines: np.ndarray
    material: np.ndarray
    directions: np.ndarray
    shares: np.ndarray
    losses: np.ndarray
    materials: Tuple[Material, ...]

    @classmethod
    def of_ranges(
        cls,
        ranges: np.ndarray,
        directions: Optional[np.ndarray] = None,
        cosines: Optional[np.ndarray] = None,
        material: Optional[np.ndarray] = None,
        materials: Tuple[Material, ...] = (DEFAULT_MATERIAL,),
    ) -> "Contacts":
        """Build from ranges (beams, rays) of rays that represent equal shares of their beam.

        By default, rays are along the beam's axis and hit the default material at right angles.
        """
        ranges = np.atleast_2d(np.asarray(ranges, dtype=np.float64))
        ones = np.ones_like(ranges)
        ahead = np.broadcast_to(np.array([1.0, 0.0, 0.0]), (*ranges.shape, 3))
        return cls(
            ranges=ranges,
            cosines=ones if cosines is None else np.broadcast_to(cosines, ranges.shape),
            material=np.zeros(ranges.shape, np.intp) if material is None else np.broadcast_to(material, ranges.shape),
            directions=ahead if directions is None else np.broadcast_to(directions, (*ranges.shape, 3)),
            shares=ones / max(1, ranges.shape[1]),
            losses=ones,
            materials=materials,
        )

    @staticmethod
    def joined(parts: Sequence["Contacts"]) -> "Contacts":
        """Return the contacts of all parts side by side; the parts have the same beams and materials."""
        if len(parts) == 1:
            return parts[0]
        names = ("ranges", "cosines", "material", "directions", "shares", "losses")
        both = {name: np.concatenate([getattr(part, name) for part in parts], axis=1) for name in names}
        return Contacts(materials=parts[0].materials, **both)
