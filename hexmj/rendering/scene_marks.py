"""Marks within a scene of MuJoCo: the support polygon, the projected centre of mass, feet and planned tips."""

from itertools import pairwise

import mujoco
import numpy as np

from hexmj.body import Marks

STABLE = (0.05, 0.55, 0.32)
UNSTABLE = (0.84, 0.24, 0.02)
"""Red, green and blue from 0 to 1 of support polygons; an unstable polygon is also unfilled, with a thick outline."""

CENTRE = (0.98, 0.72, 0.10)
TIP = (0.13, 0.36, 0.72)

EMISSION = 0.3
"""Fraction of a mark's colour that does not depend on the light."""


def mark_support(scene: mujoco.MjvScene, marks: Marks, corners: np.ndarray, level: float, stable: bool) -> None:
    """Mark the support polygon with the corners `corners`, (corner, 2), in order, at the height `level` [mm]."""
    colour = STABLE if stable else UNSTABLE
    points = np.column_stack([corners, np.full(len(corners), level + marks.fill_height)])
    for second, third in pairwise(points[1:]) if stable else ():
        _triangle(scene, points[0], second, third, (*colour, 0.35))
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        if (a != b).any():
            _rod(scene, a, b, marks.outline * (1.0 if stable else 1.8), (*colour, 1.0))


def mark_centre_of_mass(scene: mujoco.MjvScene, marks: Marks, centre: np.ndarray, level: float, stable: bool) -> None:
    """Mark the centre of mass `centre`, (3,), and its projection at the height `level` [mm]."""
    below = np.array([centre[0], centre[1], level])
    _rod(scene, below, centre, marks.plumb_line, (*CENTRE, 0.8))
    rim = (*(STABLE if stable else UNSTABLE), 1.0)
    _disc(scene, below, *marks.rim, rim)
    _disc(scene, below, *marks.centre, (*CENTRE, 1.0))


def mark_planned_tips(scene: mujoco.MjvScene, marks: Marks, tips: np.ndarray) -> None:
    """Mark the commanded tips, (leg, 3) [mm], by discs around the feet."""
    for tip in tips:
        _disc(scene, tip, 2.2 * marks.tip, 0.15 * marks.tip, (*TIP, 0.8))


def mark_feet(scene: mujoco.MjvScene, marks: Marks, feet: np.ndarray, stance: np.ndarray) -> None:
    """Mark feet at `feet`, (leg, 3) [mm]: those that stand, (leg,), black, the others white."""
    for foot, stands in zip(feet, stance, strict=True):
        shade = 0.1 if stands else 1.0
        _add(scene, mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, marks.tip), foot, np.eye(3), (shade, shade, shade, 1.0))


def _rod(scene: mujoco.MjvScene, a: np.ndarray, b: np.ndarray, radius: float, rgba: tuple) -> None:
    geom = _add(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.eye(3), rgba)
    mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, radius, a, b)


def _disc(scene: mujoco.MjvScene, centre: np.ndarray, radius: float, height: float, rgba: tuple) -> None:
    _add(scene, mujoco.mjtGeom.mjGEOM_CYLINDER, np.array([radius, height, 0.0]), centre, np.eye(3), rgba)


def _triangle(scene: mujoco.MjvScene, a: np.ndarray, b: np.ndarray, c: np.ndarray, rgba: tuple) -> None:
    """Add a triangle. MuJoCo places its corners at 0, at size_x on the frame's x axis and at size_y on the y axis."""
    sides = np.stack([b - a, c - a])
    lengths = np.linalg.norm(sides, axis=1)
    x, y = sides / lengths[:, None]
    axes = np.stack([x, y, [0.0, 0.0, 1.0]], axis=1)
    _add(scene, mujoco.mjtGeom.mjGEOM_TRIANGLE, np.array([*lengths, 1.0]), a, axes, rgba)


def _add(
    scene: mujoco.MjvScene, kind: mujoco.mjtGeom, size: np.ndarray, place: np.ndarray, axes: np.ndarray, rgba: tuple
) -> mujoco.MjvGeom:
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, size, place, axes.ravel(), np.array(rgba, dtype=np.float32))
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.emission = EMISSION
    scene.ngeom += 1
    return geom
