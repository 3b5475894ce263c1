"""Functions of a root's unit quaternion (w, x, y, z): rotated vectors, heading, tilt and lowest point."""

from typing import Any

import numpy as np

from hexmj.jitted import inlined, part


def rotated(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return vectors, (..., 3), rotated by unit quaternions, (..., 4)."""
    w, axis = quaternion[..., :1], quaternion[..., 1:]
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)


def heading(quaternion: np.ndarray) -> np.ndarray:
    """Return the direction in which the root points, (...) [rad], counter-clockwise from the world's x axis."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def turned(points: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return points on the plane, (..., point, 2), rotated counter-clockwise by angles, (...) [rad]."""
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    ahead, left = points[..., 0], points[..., 1]
    return np.stack([cos * ahead - sin * left, sin * ahead + cos * left], axis=-1)


def lean(quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far a root's forward and left axes point below the horizontal, (..., 2) [sine], and its tilt [rad]."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    leans = np.stack([2.0 * (w * y - x * z), -2.0 * (w * x + y * z)], axis=-1)
    return leans, np.arctan2(np.linalg.norm(leans, axis=-1), 1.0 - 2.0 * (x * x + y * y))


@part
def lowest(qpos: Any, corners: Any, radii: Any) -> float:
    """Return the height of the lowest point of spheres that are fixed to a root [mm], for compiled code.

    Args:
        qpos: position and quaternion of the root; further elements are ignored, (position,).
        corners: centres of the spheres in the root frame, (corner, axis) [mm].
        radii: radii of the spheres, (corner,) [mm].
    """
    _, _, _, _, _, _, up_x, up_y, up_z = matrix(qpos[3], qpos[4], qpos[5], qpos[6])
    least = np.inf
    for c in range(len(corners)):
        height = qpos[2] + up_x * corners[c, 0] + up_y * corners[c, 1] + up_z * corners[c, 2] - radii[c]
        least = min(least, height)
    return least


@inlined
def matrix(w: float, x: float, y: float, z: float) -> Any:
    """Return the rotation matrix of a unit quaternion as nine numbers, row by row, for compiled code."""
    return (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip
