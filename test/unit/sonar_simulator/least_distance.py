"""The nearest surface inside a beam by another way than the simulator's: least distance programming on each triangle.

A triangle is an intersection of half-spaces and so is a beam; the point of both that is nearest to the sonar is the
solution of: minimise |x| subject to G x >= h, which non-negative least squares solves exactly (Lawson and Hanson 1974,
chapter 23.4).
"""

import math

import numpy as np
from scipy.optimize import nnls

_SCALE = 50.0
_INFEASIBLE = 1e-7


def nearest_range(world, T_world_beam, planes, max_range):
    """Return the distance, m, of the nearest surface of a world in the beam, inf beyond `max_range`.

    planes: (k, 3) inward normals of the beam's sides in its frame.
    """
    T_beam_world = np.linalg.inv(T_world_beam)
    corners = (world.vertices @ T_beam_world[:3, :3].T + T_beam_world[:3, 3])[world.faces]
    behind = (corners @ planes.T < 0.0).all(axis=1).any(axis=1)
    corners = corners[~behind]
    centres = corners.mean(axis=1)
    bounds = np.linalg.norm(centres, axis=1) - np.linalg.norm(corners - centres[:, np.newaxis], axis=2).max(axis=1)
    best = max_range
    for number in np.argsort(bounds):
        if bounds[number] > best:
            break
        best = min(best, _least_distance(corners[number], planes))
    return best if best < max_range else math.inf


def _least_distance(corners, planes):
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal = normal / np.linalg.norm(normal)
    inward = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    G = np.vstack([planes, normal, -normal, inward])
    height = normal @ corners.mean(axis=0)
    h = np.concatenate([np.zeros(len(planes)), [height, -height], np.einsum("ij,ij->i", inward, corners)]) / _SCALE
    weights, _ = nnls(np.vstack([G.T, h]), np.array([0.0, 0.0, 0.0, 1.0]))
    residual = np.append(G.T @ weights, h @ weights - 1.0)
    if np.linalg.norm(residual) < _INFEASIBLE:
        return math.inf
    return float(np.linalg.norm(residual[:3] / residual[3]) * _SCALE)
