"""The rays of a beam (fan, fan with side lobes, cone), their ends, and exactly the nearest surface inside each beam."""

import math
from dataclasses import dataclass
from typing import Optional, Sequence, Tuple, Union

import numpy as np

from node_support.geometry import matrices
from sonar_simulator.echoes.ray_caster import Leg, Mirrors, RayCaster, legs
from sonar_simulator.world.world import DEFAULT_MATERIAL, Material

# Gazebo's unit_cone, the shape of the thesis's sensor, is also a pyramid with many sides.
_SIDES = 16


@dataclass(frozen=True)
class BeamPattern:
    """A fan: a pyramid of rows x columns rays, one in each stratum of equal angles (thesis 4.1.1, 6.4.3).

    vertical_opening, horizontal_opening: full angles of the beam, rad, below pi. side_rays: so many more rays over all
    bearings at the fan's elevations; what only these side lobes hear is not part of the beam.
    """

    vertical_opening: float
    horizontal_opening: float
    rows: int
    columns: int
    side_rays: int = 0

    @property
    def rays_inside(self) -> int:
        """Number of rays, from the first, that are between the planes."""
        return self.rows * self.columns

    @property
    def rays(self) -> int:
        return self.rays_inside + self.side_rays

    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam, x along its axis and z up.

        Every beam gets its own jitter: rays at fixed elevations would draw the floor as concentric arcs.
        """
        if not self.side_rays:
            return self._fan(beams, rng)
        jitter = rng.random((2, beams, self.side_rays))
        bearing = 2.0 * math.pi * (np.arange(self.side_rays) + jitter[0]) / self.side_rays
        elevation = (jitter[1] - 0.5) * self.vertical_opening
        level = np.cos(elevation)
        side = np.stack([level * np.cos(bearing), level * np.sin(bearing), np.sin(elevation)], axis=-1)
        return np.concatenate([self._fan(beams, rng), side], axis=1)

    def _fan(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        jitter = rng.random((2, beams, self.rows, self.columns))
        row = np.arange(self.rows)[:, np.newaxis]
        elevation = ((row + jitter[0]) / self.rows - 0.5) * self.vertical_opening
        bearing = ((np.arange(self.columns) + jitter[1]) / self.columns - 0.5) * self.horizontal_opening
        slopes = np.stack([np.ones_like(bearing), np.tan(bearing), np.tan(elevation)], axis=-1)
        slopes /= np.sqrt(np.einsum("...i,...i", slopes, slopes))[..., np.newaxis]
        return slopes.reshape(beams, self.rays_inside, 3)

    def planes(self) -> np.ndarray:
        """Return (4, 3) unit normals, inward, of the beam's right, left, lower and upper side."""
        across, up = self.horizontal_opening / 2.0, self.vertical_opening / 2.0
        sides = [[math.sin(across), sign * math.cos(across), 0.0] for sign in (1.0, -1.0)]
        return np.array(sides + [[math.sin(up), 0.0, sign * math.cos(up)] for sign in (1.0, -1.0)])

    def shares(self) -> np.ndarray:
        """Return (rays,) the share of the fan's solid angle that each ray represents."""
        turns = 2.0 * math.pi / self.horizontal_opening if self.side_rays else 0.0
        side = np.full(self.side_rays, turns / max(1, self.side_rays))
        return np.concatenate([np.full(self.rays_inside, 1.0 / self.rays_inside), side])


@dataclass(frozen=True)
class ConePattern:
    """Rays spread evenly over a cone of full angle `opening`, rad (thesis 6.4.1, 6.4.2).

    The cone is a pyramid with 16 sides, like a mesh of a cone; each flat side touches the round cone from outside.
    """

    opening: float
    rays: int

    @property
    def rays_inside(self) -> int:
        return self.rays

    def sample(self, beams: int, rng: np.random.Generator) -> np.ndarray:
        """Return (beams, rays, 3) unit vectors in the frame of the beam: a sunflower, rotated anew for each beam."""
        number = np.arange(self.rays)
        turn = number * math.pi * (3.0 - math.sqrt(5.0)) + 2.0 * math.pi * rng.random((beams, 1))
        radius = math.tan(self.opening / 2.0) * np.sqrt((number + rng.random((beams, self.rays))) / self.rays)
        slopes = np.stack([np.ones_like(turn), radius * np.cos(turn), radius * np.sin(turn)], axis=-1)
        return slopes / np.sqrt(np.einsum("...i,...i", slopes, slopes))[..., np.newaxis]

    def planes(self) -> np.ndarray:
        """Return (16, 3) unit normals, inward; four of them bound the cone below, above, right and left."""
        half = self.opening / 2.0
        turn = np.arange(_SIDES) * 2.0 * math.pi / _SIDES
        return np.column_stack(
            [np.full(_SIDES, math.sin(half)), -math.cos(half) * np.cos(turn), -math.cos(half) * np.sin(turn)]
        )

    def shares(self) -> np.ndarray:
        """Return (rays,) the share of the beam's solid angle that each ray represents."""
        return np.full(self.rays, 1.0 / self.rays)


RayPattern = Union[BeamPattern, ConePattern]
"""Rays inside a beam that is a convex pyramid, whose planes all pass through the sonar."""


def head_turns(angles: np.ndarray) -> np.ndarray:
    """Return (beams, 3, 3) rotations from the frames of beams at head `angles` (beams,), rad, to the sonar's frame."""
    return matrices(np.column_stack([np.zeros((len(angles), 2)), angles]))[:, :3, :3]


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
