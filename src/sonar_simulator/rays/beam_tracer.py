"""Finds what beams meet: the ends of their rays, and exactly the nearest surface inside each."""

from dataclasses import dataclass
from typing import Optional, Sequence, Tuple

import numpy as np

from sonar_simulator.rays.beam_pattern import RayPattern, head_turns
from sonar_simulator.rays.ray_caster import Leg, Mirrors, RayCaster, legs
from sonar_simulator.world.world import DEFAULT_MATERIAL, Material

# The nearest surface may be a sliver of the beam, so its ray represents a tenth of what another ray does.
_LEADING_SHARE = 0.1
_AHEAD = np.array([1.0, 0.0, 0.0])


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
        cls, ranges: np.ndarray, directions: Optional[np.ndarray] = None, cosines: Optional[np.ndarray] = None,
        material: Optional[np.ndarray] = None, materials: Tuple[Material, ...] = (DEFAULT_MATERIAL,),
    ) -> "Contacts":  # fmt: skip
        """Build from ranges (beams, rays) of rays that represent equal shares of their beam.

        By default, rays are along the beam's axis and hit the default material at right angles.
        """
        ranges = np.atleast_2d(np.asarray(ranges, dtype=np.float64))
        ones = np.ones_like(ranges)
        ahead = np.broadcast_to(np.array([1.0, 0.0, 0.0]), (*ranges.shape, 3))
        return cls(
            ranges=ranges, cosines=ones if cosines is None else np.broadcast_to(cosines, ranges.shape),
            material=np.zeros(ranges.shape, np.intp) if material is None else np.broadcast_to(material, ranges.shape),
            directions=ahead if directions is None else np.broadcast_to(directions, (*ranges.shape, 3)),
            shares=ones / max(1, ranges.shape[1]), losses=ones, materials=materials,
        )  # fmt: skip

    @staticmethod
    def joined(parts: Sequence["Contacts"]) -> "Contacts":
        """Return the contacts of all parts side by side; the parts have the same beams and materials."""
        names = ("ranges", "cosines", "material", "directions", "shares", "losses")
        both = {name: np.concatenate([getattr(part, name) for part in parts], axis=1) for name in names}
        return Contacts(materials=parts[0].materials, **both)


NO_MIRRORS = Mirrors()


class BeamTracer:
    """Casts the rays of a pattern, and one more ray per beam at the nearest surface inside it."""

    def __init__(self, caster: RayCaster, pattern: RayPattern, mirrors: Mirrors = NO_MIRRORS) -> None:
        self._caster = caster
        self._pattern = pattern
        self._mirrors = mirrors
        self._nearest = caster.nearest
        self._planes = pattern.planes()
        self._shares = pattern.shares()

    def contacts(
        self, T_world_sonar: np.ndarray, angles: np.ndarray, max_range: float, rng: np.random.Generator
    ) -> Contacts:
        """Return what beams at head `angles` (beams,) rad from poses (beams, 4, 4) hit within `max_range` m.

        The first contact of every beam is exactly the nearest surface inside it; those of the rays follow.
        """
        rotations = T_world_sonar[:, :3, :3] @ head_turns(angles)
        origins = T_world_sonar[:, :3, 3]
        sampled = self._pattern.sample(len(angles), rng)
        directions = (sampled @ rotations.transpose(0, 2, 1)).reshape(-1, 3)
        starts = np.repeat(origins, self._pattern.rays, axis=0)
        ways = legs(self._caster, starts, directions, self._mirrors, max_range)
        met = [self._contacts(leg, sampled, self._shares) for leg in ways]
        limits = np.minimum(met[0].ranges[:, : self._pattern.rays_inside].min(axis=1), max_range)
        return Contacts.joined([self._leading(origins, rotations, limits), *met])

    def _contacts(self, leg: Leg, directions: np.ndarray, shares: np.ndarray) -> Contacts:
        """Return the ends of a leg as contacts of rays that left along beam-frame `directions` (beams, rays, 3)."""
        world, shape = self._caster.world, directions.shape[:2]
        cosines = np.abs(np.einsum("ij,ij->i", leg.directions, world.normals[leg.faces]))
        return Contacts(
            ranges=leg.ranges.reshape(shape), cosines=np.minimum(cosines, 1.0).reshape(shape),
            material=world.face_material[leg.faces].reshape(shape), directions=directions,
            shares=np.broadcast_to(shares, shape), losses=leg.left.reshape(shape), materials=world.materials,
        )  # fmt: skip

    def _leading(self, origins: np.ndarray, rotations: np.ndarray, limits: np.ndarray) -> Contacts:
        points, faces = self._nearest.find(origins, rotations, self._planes, limits)
        above = origins[:, 2] + np.einsum("ni,ni->n", rotations[:, 2], np.where(np.isfinite(points), points, 0.0)) > 0.0
        faces = np.where(self._mirrors.surface & above, -1, faces)
        found = faces >= 0
        ranges = np.where(found, np.sqrt(np.einsum("ij,ij->i", points, points)), np.inf)
        scale = np.where(found, np.maximum(ranges, 1e-12), 1.0)[:, np.newaxis]
        directions = np.where(found[:, np.newaxis], points / scale, _AHEAD)
        in_world = np.einsum("nij,nj->ni", rotations, directions)
        leg = Leg(ranges, faces, in_world, np.ones(len(origins)))
        return self._contacts(leg, directions[:, np.newaxis], self._shares[:1] * _LEADING_SHARE)
