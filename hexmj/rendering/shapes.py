"""Triangles of the visible parts of a compiled body and of its ground."""

from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.ground import BUMPS, ground_level

AROUND, RINGS = 14, 4
"""Number of corners on each ring around a round geom (AROUND), and of rings on each of its two ends (RINGS)."""

FLAT = 1e-3
"""Height of the ends of a cylinder over its radius."""

UNSET_COLOUR = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom without a colour of its own."""

VISIBLE_GROUPS = 3
"""Geoms of the groups below this number are visible, as in MuJoCo's renderer."""

PER_BUMP = 8
"""Number of points on the ground's surface from one bump to the next."""

KINDS = mujoco.mjtGeom


class Shape(NamedTuple):
    """Triangles whose corners belong to bodies of a MuJoCo model."""

    corners: np.ndarray
    """(corner, 3) in the frame of its body [mm]."""
    normals: np.ndarray
    """(corner, 3) outward normals of unit length in the frame of the body."""
    faces: np.ndarray
    """(face, 3) indices of the corners, counter-clockwise seen from outside."""
    colour: np.ndarray
    """(corner, 3) red, green, blue from 0 to 1."""
    body: np.ndarray
    """(corner,) MuJoCo's index of the body."""


def body_shapes(model: mujoco.MjModel) -> list[Shape]:
    """Return the shapes of the visible geoms of all moving bodies."""
    shown = (model.geom_bodyid > 0) & (model.geom_group < VISIBLE_GROUPS)
    return [geom_shape(model, geom) for geom in np.flatnonzero(shown).tolist() if _rgba(model, geom)[3] > 0]


def ground_shape(compiled: CompiledBody) -> Shape:
    """Return the shape of the obstacles, which are boxes or rough ground, without the flat plane."""
    model, conditions = compiled.model, compiled.conditions
    boxes = (i for i in range(model.ngeom) if not model.geom_bodyid[i] and model.geom_type[i] == KINDS.mjGEOM_BOX)
    shapes = [geom_shape(model, i) for i in boxes]
    if conditions.ground == "rough":
        spacing, margin = conditions.body.lengths.bump_spacing, conditions.body.lengths.highest_bump
        along, across = (spacing * (count - 1) + 2 * margin for count in BUMPS)
        x, y = (np.arange(0.0, length + spacing / PER_BUMP, spacing / PER_BUMP) for length in (along, across))
        places = np.stack(np.meshgrid(x + conditions.ground_at, y - across / 2, indexing="ij"), axis=-1)
        shapes.append(_surface(places, ground_level(conditions, places)))
    return joined(shapes)


def joined(shapes: Iterable[Shape]) -> Shape:
    """Join shapes into one; without any, it has no corners."""
    empty = np.empty((0, 3))
    parts = [Shape(empty, empty, empty.astype(int), empty, np.empty(0, int)), *shapes]
    first = np.cumsum([0, *(len(part.corners) for part in parts[:-1])])
    faces = np.concatenate([part.faces + n for part, n in zip(parts, first, strict=True)])
    return Shape(*map(np.concatenate, zip(*parts, strict=True)))._replace(faces=faces)


def geom_shape(model: mujoco.MjModel, geom: int) -> Shape:
    """Return the shape of one geom; it is empty for a plane."""
    kind, size = KINDS(model.geom_type[geom]), model.geom_size[geom]
    if kind in (KINDS.mjGEOM_SPHERE, KINDS.mjGEOM_CAPSULE, KINDS.mjGEOM_CYLINDER, KINDS.mjGEOM_ELLIPSOID):
        corners, normals, faces = _round(kind, size)
    elif kind == KINDS.mjGEOM_BOX:
        corners, normals, faces = _box(size)
    elif kind == KINDS.mjGEOM_MESH:
        corners, normals, faces = _mesh(model, int(model.geom_dataid[geom]))
    else:
        return joined([])
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    turn = turn.reshape(3, 3).T
    colour, body = np.tile(_rgba(model, geom)[:3], (len(corners), 1)), np.full(len(corners), model.geom_bodyid[geom])
    return Shape(corners @ turn + model.geom_pos[geom], normals @ turn, faces, colour, body)


def _surface(places: np.ndarray, height: np.ndarray) -> Shape:
    """Return the surface of heights (i, j) over grid points (i, j, 2) [mm], without faces at height 0."""
    corners = np.concatenate([places, height[..., None]], axis=-1).reshape(-1, 3)
    slopes = np.gradient(height, places[:, 0, 0], places[0, :, 1])
    normals = np.stack([-slopes[0], -slopes[1], np.ones_like(height)], axis=-1).reshape(-1, 3)
    faces = _lattice(*height.shape)
    faces = faces[(height.ravel()[faces] > 0).any(axis=1)]
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return Shape(corners, unit, faces, np.zeros_like(corners), np.zeros(len(corners), int))


def _rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return the colour that MuJoCo draws: the geom's own, or the material's if the geom has no own colour."""
    material, own = model.geom_matid[geom], model.geom_rgba[geom]
    return model.mat_rgba[material] if material >= 0 and (own == UNSET_COLOUR).all() else own


def _round(kind: mujoco.mjtGeom, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return corners, normals and faces of a sphere or an ellipsoid, or of its two halves at a distance.

    The halves of a capsule are hemispheres; those of a cylinder are flat.
    """
    rise = np.linspace(-np.pi / 2, 0.0, RINGS + 1)
    rise, angle = np.append(rise, -rise[::-1])[:, None], np.linspace(0.0, 2 * np.pi, AROUND + 1)
    unit = [np.cos(rise) * np.cos(angle), np.cos(rise) * np.sin(angle), np.sin(rise)]
    unit = np.stack(np.broadcast_arrays(*unit), axis=-1)
    flat = FLAT if kind == KINDS.mjGEOM_CYLINDER else 1.0
    scale = size if kind == KINDS.mjGEOM_ELLIPSOID else size[0] * np.array([1.0, 1.0, flat])
    corners, normals = unit * scale, unit / scale
    if kind in (KINDS.mjGEOM_CAPSULE, KINDS.mjGEOM_CYLINDER):
        corners[..., 2] += np.where(np.arange(len(rise)) <= RINGS, -size[1], size[1])[:, None]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return corners.reshape(-1, 3), normals.reshape(-1, 3), _lattice(len(rise), len(angle))[:, ::-1]


def _lattice(rows: int, columns: int) -> np.ndarray:
    """Return two triangles for each cell of a grid of corners, (face, 3) indices of corners."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    halves = [first, first + columns, first + 1], [first + 1, first + columns, first + columns + 1]
    return np.concatenate([np.stack(half, axis=1) for half in halves])


def _box(size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return corners, normals and faces of a box with half sizes `size`, (3,) [mm]."""
    square, sides = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]), [(a, side) for a in range(3) for side in (-1, 1)]
    corners = [np.roll(np.column_stack([np.full(4, side), square[::side]]), a, axis=1) for a, side in sides]
    normals = [np.tile(side * np.eye(3)[a], (4, 1)) for a, side in sides]
    faces = 4 * np.arange(6)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])
    return np.concatenate(corners) * size, np.concatenate(normals), faces.reshape(-1, 3)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return corners, normals and faces of a mesh; a point with several normals becomes several corners."""
    rows = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    pairs = np.stack([model.mesh_face[rows], model.mesh_facenormal[rows]], axis=-1).reshape(-1, 2)
    distinct, faces = np.unique(pairs, axis=0, return_inverse=True)
    corners = model.mesh_vert[model.mesh_vertadr[mesh] + distinct[:, 0]]
    normals = model.mesh_normal[model.mesh_normaladr[mesh] + distinct[:, 1]]
    return corners.astype(float), normals.astype(float), faces.reshape(-1, 3)
