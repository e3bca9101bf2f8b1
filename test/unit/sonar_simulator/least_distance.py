"""The nearest surface inside a beam by another way than the simulator's: least distance programming on the shapes.

A solid is an intersection of half-spaces and so is a beam; the point of both that is nearest to the sonar is the
solution of: minimise |x| subject to G x >= h, which non-negative least squares solves exactly (Lawson and Hanson 1974,
chapter 23.4). Round surfaces get tangent planes where the solution leaves them, until it does not. No triangles are
involved but those of meshes.
"""

import math
from functools import partial

import numpy as np
from scipy.optimize import nnls

_SCALE = 50.0
_INFEASIBLE = 1e-7
_ROUND = 1e-5
_TURN = np.arange(12) * math.pi / 6.0
# Where the first tangent planes of a round surface touch it, in its axes: around the third one, and at both its ends.
_AROUND = np.vstack([np.column_stack([np.cos(_TURN), np.sin(_TURN), np.zeros(12)]), [[0, 0, 1], [0, 0, -1]]])


def nearest_range(world, T_world_beam, planes, max_range):
    """Return the distance, m, of the nearest surface of a world in the beam, inf beyond `max_range`.

    planes: (k, 3) inward normals of the beam's sides in its frame; the sonar must stand outside all solids.
    """
    T_beam_world = np.linalg.inv(T_world_beam)
    best = max_range
    for shape in world.shapes:
        pieces = _triangles(shape, T_beam_world, planes) if shape.kind == "mesh" else [_solid(shape, T_beam_world)]
        for lower_bound, surface in sorted(pieces, key=lambda piece: piece[0]):
            if lower_bound > best:
                break
            faces, tangent = surface()
            best = min(best, _least_distance([(plane, 0.0) for plane in planes] + faces, tangent))
    return best if best < max_range else math.inf


def _least_distance(half_spaces, tangent):
    half_spaces = list(half_spaces)
    for _ in range(200):
        G = np.array([normal for normal, _ in half_spaces])
        h = np.array([offset for _, offset in half_spaces]) / _SCALE
        weights, _ = nnls(np.vstack([G.T, h]), np.array([0.0, 0.0, 0.0, 1.0]))
        residual = np.append(G.T @ weights, h @ weights - 1.0)
        if np.linalg.norm(residual) < _INFEASIBLE:
            return math.inf
        point = -residual[:3] / residual[3] * _SCALE
        cut = tangent(point)
        if cut is None:
            return float(np.linalg.norm(point))
        half_spaces.append(cut)
    raise AssertionError("no solution after 200 tangent planes")


def _solid(shape, T_beam_world):
    """Return a lower bound of the distance, and what makes a primitive's half-spaces and cuts its round sides."""
    pose = T_beam_world @ shape.pose
    centre, axes = pose[:3, 3], pose[:3, :3].T
    if shape.kind in ("box", "plane"):
        return _flat_solid(shape, centre, axes)
    reach = math.hypot(shape.size[0], shape.size[1] / 2.0) if shape.kind == "cylinder" else shape.size[0]
    return max(0.0, np.linalg.norm(centre) - reach), lambda: _round_solid(shape, centre, axes)


def _flat_solid(shape, centre, axes):
    if shape.kind == "plane":
        half = np.minimum(np.array([*shape.size, 0.0]) / 2.0, 1e5)
        return 0.0, lambda: (_slabs(centre, axes, half), lambda point: None)
    half = np.array(shape.size) / 2.0
    bound = max(0.0, np.linalg.norm(centre) - np.linalg.norm(half))
    return bound, lambda: (_slabs(centre, axes, half), lambda point: None)


def _round_solid(shape, centre, axes):
    radius = shape.size[0]
    along = axes[2] if shape.kind == "cylinder" else np.zeros(3)
    caps = _slabs(centre, axes[2:], [shape.size[1] / 2.0]) if shape.kind == "cylinder" else []

    def tangent(point):
        outward = point - centre
        outward = outward - (outward @ along) * along
        distance = np.linalg.norm(outward)
        if distance <= radius + _ROUND:
            return None
        return -outward / distance, -(outward / distance @ centre + radius)

    outward = _AROUND @ axes if shape.kind == "sphere" else _AROUND[:-2] @ axes
    return caps + list(zip(-outward, -(outward @ centre + radius))), tangent


def _slabs(centre, axes, halves):
    return [(-sign * axis, -(sign * axis @ centre + half)) for axis, half in zip(axes, halves) for sign in (1.0, -1.0)]


def _triangles(shape, T_beam_world, planes):
    vertices, faces = shape.triangles()
    corners = (vertices @ T_beam_world[:3, :3].T + T_beam_world[:3, 3])[faces]
    behind = (corners @ planes.T < 0.0).all(axis=1).any(axis=1)
    corners = corners[~behind]
    centres = corners.mean(axis=1)
    bounds = np.linalg.norm(centres, axis=1) - np.linalg.norm(corners - centres[:, np.newaxis], axis=2).max(axis=1)
    return [(max(0.0, bound), partial(_triangle, corner)) for bound, corner in zip(bounds, corners)]


def _triangle(corners):
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal = normal / np.linalg.norm(normal)
    height = normal @ corners.mean(axis=0)
    half_spaces = [(normal, height), (-normal, -height)]
    for start, end in zip(corners, np.roll(corners, -1, axis=0)):
        inward = np.cross(normal, end - start)
        inward = inward / np.linalg.norm(inward)
        half_spaces.append((inward, inward @ start))
    return half_spaces, lambda point: None
