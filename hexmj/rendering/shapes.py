"""What is seen of a compiled body and of its ground, as triangles."""

from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.ground import BUMPS, ground_level

AROUND, RINGS = 14, 4
"""Corners around a round thing, and rings of each of its ends."""

UNTOLD = (0.5, 0.5, 0.5, 1.0)
"""The colour of a geom that has none of its own."""

SEEN = 3
"""Groups of geoms below this are shown, as MuJoCo's own renderer has it."""

FINE = 8
"""Points of the ground's surface from one bump to the next."""

KINDS = mujoco.mjtGeom


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles, each of a body that moves as a whole."""

    corners: np.ndarray
    """(corner, 3) in the frame of its body [mm]."""
    normals: np.ndarray
    """(corner, 3) of unit length."""
    faces: np.ndarray
    """(face, 3) corners, counter-clockwise seen from outside."""
    colour: np.ndarray
    """(corner, 3) red, green, blue from 0 to 1."""
    body: np.ndarray
    """(corner,) number of the body."""


def body_shape(model: mujoco.MjModel) -> Shape:
    """All that moves."""
    return joined(geom_shape(model, i) for i in range(model.ngeom) if model.geom_bodyid[i] and _seen(model, i))


def ground_shape(compiled: CompiledBody) -> Shape:
    """What lies on the plane or ahead of the feet, without the plane itself."""
    model, conditions = compiled.model, compiled.conditions
    lengths = conditions.body.lengths
    laid = (i for i in range(model.ngeom) if not model.geom_bodyid[i] and model.geom_type[i] == KINDS.mjGEOM_BOX)
    shapes = [geom_shape(model, i) for i in laid]
    if conditions.ground == "rough":
        spacing, margin = lengths.bump_spacing, lengths.highest_bump
        along, across = (spacing * (count - 1) + 2 * margin for count in BUMPS)
        x, y = (np.arange(0.0, length + spacing / FINE, spacing / FINE) for length in (along, across))
        places = np.stack(np.meshgrid(x + conditions.ground_at, y - across / 2, indexing="ij"), axis=-1)
        shapes.append(surface(places, ground_level(conditions, places)))
    return joined(shapes)


def joined(shapes: Iterable[Shape]) -> Shape:
    """One shape of several; of none, one without corners."""
    none, nothing = np.empty((0, 3)), np.empty(0, int)
    every = [Shape(none, none, none.astype(int), none, nothing)]
    every += shapes
    first = np.cumsum([0, *(len(one.corners) for one in every[:-1])])
    faces = np.concatenate([one.faces + n for one, n in zip(every, first, strict=True)])
    rest = {name: np.concatenate([getattr(one, name) for one in every]) for name in vars(every[0]) if name != "faces"}
    return Shape(faces=faces, **rest)


def geom_shape(model: mujoco.MjModel, geom: int) -> Shape:
    """One geom; of a kind without an outline of its own, such as a plane, nothing."""
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
    turn = turn.reshape(3, 3)
    return Shape(
        corners=corners @ turn.T + model.geom_pos[geom],
        normals=normals @ turn.T,
        faces=faces,
        colour=np.tile(_rgba(model, geom)[:3], (len(corners), 1)),
        body=np.full(len(corners), model.geom_bodyid[geom]),
    )


def surface(places: np.ndarray, height: np.ndarray) -> Shape:
    """The ground at places on a grid, (i, j, 2), where its height, (i, j), is above 0 [mm]."""
    corners = np.concatenate([places, height[..., None]], axis=-1).reshape(-1, 3)
    slopes = np.gradient(height, places[:, 0, 0], places[0, :, 1])
    normals = np.stack([-slopes[0], -slopes[1], np.ones_like(height)], axis=-1).reshape(-1, 3)
    faces = _lattice(*height.shape)
    faces = faces[(height.ravel()[faces] > 0).any(axis=1)]
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return Shape(corners, unit, faces, np.zeros_like(corners), np.zeros(len(corners), int))


def _seen(model: mujoco.MjModel, geom: int) -> bool:
    return bool(model.geom_group[geom] < SEEN and _rgba(model, geom)[3] > 0)


def _rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """As MuJoCo draws it: in its material's colour unless it has one of its own."""
    material, own = model.geom_matid[geom], model.geom_rgba[geom]
    return model.mat_rgba[material] if material >= 0 and (own == UNTOLD).all() else own


def _round(kind: mujoco.mjtGeom, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners, normals and faces of what is round about its z axis: a profile, turned."""
    rise = np.linspace(-np.pi / 2, 0.0, RINGS + 1)
    if kind == KINDS.mjGEOM_CYLINDER:
        radius, z = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 0.0]), np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
        out, up = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]), np.array([-1.0, -1.0, 0.0, 0.0, 1.0, 1.0])
        scale, length = (size[0], size[0], size[1]), 0.0
    else:
        radius = out = np.concatenate([np.cos(rise), np.cos(rise[::-1])])
        z = up = np.concatenate([np.sin(rise), -np.sin(rise[::-1])])
        scale = size if kind == KINDS.mjGEOM_ELLIPSOID else (size[0],) * 3
        length = size[1] if kind == KINDS.mjGEOM_CAPSULE else 0.0
    angle = np.linspace(0.0, 2 * np.pi, AROUND + 1)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    corners = _turned(radius, z, way) * scale
    corners[..., 2] += np.where(np.arange(len(z)) < len(z) // 2, -length, length)[:, None]
    normals = _turned(out, up, way) / scale
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return corners.reshape(-1, 3), normals.reshape(-1, 3), _lattice(len(z), len(angle))[:, ::-1]


def _turned(out: np.ndarray, up: np.ndarray, way: np.ndarray) -> np.ndarray:
    """A profile, (ring,) outwards and upwards, turned into directions on the plane, (corner, 2): (ring, corner, 3)."""
    upwards = np.broadcast_to(up[:, None, None], (len(up), len(way), 1))
    return np.concatenate([out[:, None, None] * way, upwards], axis=-1)


def _lattice(rows: int, columns: int) -> np.ndarray:
    """Two triangles for each cell of a grid of corners, (face, 3)."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    halves = [first, first + columns, first + 1], [first + 1, first + columns, first + columns + 1]
    return np.concatenate([np.stack(half, axis=1) for half in halves])


def _box(size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners, normals and faces of a box by its half sizes."""
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners, normals = [], []
    for axis in range(3):
        for side in (-1, 1):
            one = np.insert(square[::side], axis, side, axis=1) if axis != 1 else np.insert(square[::-side], 1, side, 1)
            corners.append(one * size)
            normals.append(np.tile(side * np.eye(3)[axis], (4, 1)))
    quarters = 4 * np.arange(6)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])
    return np.concatenate(corners), np.concatenate(normals), quarters.reshape(-1, 3)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners, normals and faces of a mesh; corners of different normals are different ones."""
    rows = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    pairs = np.stack([model.mesh_face[rows], model.mesh_facenormal[rows]], axis=-1).reshape(-1, 2)
    distinct, faces = np.unique(pairs, axis=0, return_inverse=True)
    corners = model.mesh_vert[model.mesh_vertadr[mesh] + distinct[:, 0]]
    normals = model.mesh_normal[model.mesh_normaladr[mesh] + distinct[:, 1]]
    return corners.astype(float), normals.astype(float), faces.reshape(-1, 3)
