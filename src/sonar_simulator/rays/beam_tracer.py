"""Follows the sound of beams through a world to the first surface and, off mirrors, to further ones."""

import numpy as np

from sonar_simulator.rays.beam_pattern import RayPattern, head_turns
from sonar_simulator.rays.contacts import Contacts
from sonar_simulator.rays.mirrors import Leg, Mirrors, legs
from sonar_simulator.rays.ray_caster import RayCaster

# The nearest surface may be a sliver of the beam, so its ray represents a tenth of what another ray does.
_LEADING_SHARE = 0.1
_AHEAD = np.array([1.0, 0.0, 0.0])
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
            ranges=leg.ranges.reshape(shape),
            cosines=np.minimum(cosines, 1.0).reshape(shape),
            material=world.face_material[leg.faces].reshape(shape),
            directions=directions,
            shares=np.broadcast_to(shares, shape),
            losses=leg.left.reshape(shape),
            materials=world.materials,
        )

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
