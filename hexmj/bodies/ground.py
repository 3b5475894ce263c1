"""The ground: a plane and obstacles on it. Only feet and trunk touch it, as contact pairs.

`Conditions.ground` is its kind; `ground_height`, `ground_at`, `ground_length` and `ground_seed` describe it.
"""

import mujoco
import numpy as np

from hexmj.conditions import Conditions

BUMPS = (15, 9)
"""Bumps along the way and across it: a field of 180 by 108 mm if they are 12 mm apart."""

WITH_ENDS = "step", "hurdle", "gap"
"""Kinds of ground that end after some distance; bumps end on the plane."""

LOOK = {"contype": 0, "conaffinity": 0, "rgba": (0.78, 0.84, 0.90, 1.0)}
"""Settings of obstacles: a tint distinguishes them from the plane, whose material they share."""

CONTACT = ("condim", "friction", "solref", "solimp")
"""Settings of a contact pair with the plane that pairs with obstacles copy."""


def lay_ground(spec: mujoco.MjSpec, conditions: Conditions) -> None:
    """Add the obstacles to a spec of a body on its plane."""
    body, lengths, kinds = conditions.body, conditions.body.lengths, mujoco.mjtGeom
    near, length, height = conditions.ground_at, conditions.ground_length, conditions.ground_height
    far = lengths.ground_reach
    boxes = {
        "step": {"step": (near, near + far, height)},
        "hurdle": {"hurdle": (near, near + length, height)},
        "gap": {"bank": (-far, near, 0.0), "far_bank": (near + length, near + length + far, 0.0)},
    }
    pieces = {}  # name -> geom type, size and position
    for name, (begin, end, top) in boxes.get(conditions.ground, {}).items():
        half = (top + lengths.shortest_leg) / 2
        size = (end - begin) / 2, lengths.ground_half_width, half
        pieces[name] = kinds.mjGEOM_BOX, size, ((begin + end) / 2, 0.0, top - half)
    if conditions.ground == "gap":
        spec.geom(body.ground).pos[2] -= lengths.shortest_leg
    if conditions.ground == "rough":
        # A sphere pushes a fast foot up and out again. The prisms of a height field would push a foot that is deeper
        # than its distance from their sides into the next prism, where it stays.
        for i, ((x, y), top, radius) in enumerate(zip(*_bumps(conditions), strict=True)):
            pieces[f"bump_{i}"] = kinds.mjGEOM_SPHERE, (radius, 0.0, 0.0), (x, y, top - radius)
    look = LOOK | {"material": spec.geom(body.ground).material}
    alike = {frozenset((pair.geomname1, pair.geomname2)): pair for pair in spec.pairs}
    for name, (kind, size, place) in pieces.items():
        spec.worldbody.add_geom(name=name, type=kind, size=size, pos=place, **look)
        for touching in (*body.trunk, *body.feet):
            pair = spec.add_pair(name=f"{name}_{touching}", geomname1=name, geomname2=touching)
            for setting in CONTACT:
                setattr(pair, setting, getattr(alike[frozenset((body.ground, touching))], setting))


def ground_level(conditions: Conditions, places: np.ndarray) -> np.ndarray:
    """Height of the ground at places in the world, (..., 2) -> (...) [mm]; 0 on the plane."""
    lengths = conditions.body.lengths
    x = places[..., 0]
    if conditions.ground == "rough":
        centres, heights, radii = _bumps(conditions)
        off = np.linalg.norm(places[..., None, :] - centres, axis=-1)
        caps = np.sqrt(np.maximum(radii**2 - off**2, 0.0)) - (radii - heights)
        return np.maximum(caps.max(axis=-1), 0.0)
    end = np.inf if conditions.ground == "step" else conditions.ground_at + conditions.ground_length
    height = {"flat": 0.0, "gap": -lengths.shortest_leg}.get(conditions.ground, conditions.ground_height)
    return np.where((x > conditions.ground_at) & (x < end), height, 0.0)


def beyond_the_ground(conditions: Conditions, feet: np.ndarray) -> np.ndarray:
    """Whether feet, spheres around (..., 3) in the world [mm], are beyond the end of the ground, (...).

    Only the kinds of `WITH_ENDS` end.
    """
    lengths = conditions.body.lengths
    x, y, near, far = feet[..., 0], feet[..., 1], conditions.ground_at, lengths.ground_reach
    if conditions.ground not in WITH_ENDS:
        return np.zeros(x.shape, dtype=bool)
    past = {"hurdle": near + conditions.ground_length, "gap": near + conditions.ground_length + far, "step": near + far}
    begin, end = -far if conditions.ground == "gap" else near, past[conditions.ground]
    aside = (np.abs(y) > lengths.ground_half_width) & (x > begin) & (x < end)
    return aside | ((x > end) & (conditions.ground != "hurdle")) | ((x < begin) & (conditions.ground == "gap"))


def depth_in_ground(conditions: Conditions, feet: np.ndarray, radius: float) -> np.ndarray:
    """Depth of feet, spheres of a radius around (..., 3) in the world [mm], in the ground, (...) [mm].

    It is MuJoCo's depth along the normal; negative above the ground.
    """
    lengths = conditions.body.lengths
    z = feet[..., 2]
    if conditions.ground == "flat":
        return radius - z
    x, near, length = feet[..., 0], conditions.ground_at, conditions.ground_length
    if conditions.ground == "rough":
        return np.maximum(radius - z, _depth_in_bumps(conditions, feet, radius))
    off_middle = np.abs(x - near - length / 2)
    outside = {"step": near - x, "hurdle": off_middle - length / 2, "gap": length / 2 - off_middle}[conditions.ground]
    above = z - (0.0 if conditions.ground == "gap" else conditions.ground_height)
    from_block = np.hypot(np.maximum(outside, 0.0), np.maximum(above, 0.0)) + np.minimum(np.maximum(outside, above), 0)
    floor = -lengths.shortest_leg if conditions.ground == "gap" else 0.0
    return radius - np.minimum(from_block, z - floor)


def _depth_in_bumps(conditions: Conditions, feet: np.ndarray, radius: float) -> np.ndarray:
    """Depth in the four bumps around a foot; no other bump reaches it."""
    lengths = conditions.body.lengths
    centres, heights, radii = (values.reshape(*BUMPS, -1) for values in _bumps(conditions))
    corner = np.floor((feet[..., :2] - centres[0, 0]) / lengths.bump_spacing).astype(int)
    depth = np.full(feet.shape[:-1], -np.inf)
    for along, across in ((0, 0), (0, 1), (1, 0), (1, 1)):
        i, j = (np.clip(corner[..., k] + step, 0, BUMPS[k] - 1) for k, step in enumerate((along, across)))
        below = (heights - radii)[i, j]
        centre = np.concatenate([centres[i, j], below], axis=-1)
        depth = np.maximum(depth, radii[i, j, 0] + radius - np.linalg.norm(feet - centre, axis=-1))
    return depth


def _bumps(conditions: Conditions) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres on a square grid, (bump, 2), heights drawn uniformly up to the height, and radii, (bump,) [mm]."""
    lengths = conditions.body.lengths
    along, across = BUMPS
    x = conditions.ground_at + lengths.highest_bump + lengths.bump_spacing * np.arange(along)
    y = lengths.bump_spacing * (np.arange(across) - (across - 1) / 2)
    heights = conditions.ground_height * np.random.default_rng(conditions.ground_seed).random(along * across)
    centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return centres, heights, (lengths.highest_bump**2 + heights**2) / (2 * heights)
