"""The ground: a plane with obstacles on it. Contact pairs let only the feet and the trunk touch it.

`Conditions.ground` is the kind of ground; `ground_height`, `ground_at`, `ground_length` and `ground_seed` describe it.
"""

import mujoco
import numpy as np

from hexmj.conditions import Conditions

BUMPS = (15, 9)
"""Numbers of bumps along and across the direction of walking: at 12 mm spacing they cover 180 by 108 mm."""

WITH_ENDS = "step", "hurdle", "gap"
"""Kinds of ground with edges that an insect must not cross; on flat and rough ground the plane goes on."""

LOOK = {"contype": 0, "conaffinity": 0, "rgba": (0.78, 0.84, 0.90, 1.0)}
"""Settings of an obstacle's geom: contacts only in pairs, and a tint that distinguishes it from the plane."""

CONTACT = ("condim", "friction", "solref", "solimp")
"""Settings that contact pairs with obstacles copy from the contact pairs with the plane."""


def lay_ground(spec: mujoco.MjSpec, conditions: Conditions) -> None:
    """Add obstacles, and their contact pairs with feet and trunk, to the spec of a body on its plane."""
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
        # Bumps are spheres, since a sphere pushes a fast foot up and out. A height field consists of prisms: if a foot
        # is deeper than its distance from the side of a prism, it is pushed into the next prism and stays there.
        for i, ((x, y), top, radius) in enumerate(zip(*_bumps(conditions), strict=True)):
            pieces[f"bump_{i}"] = kinds.mjGEOM_SPHERE, (radius, 0.0, 0.0), (x, y, top - radius)
    look = LOOK | {"material": spec.geom(body.ground).material}
    with_plane = {frozenset((pair.geomname1, pair.geomname2)): pair for pair in spec.pairs}
    for name, (kind, size, place) in pieces.items():
        spec.worldbody.add_geom(name=name, type=kind, size=size, pos=place, **look)
        for touching in (*body.trunk, *body.feet):
            pair = spec.add_pair(name=f"{name}_{touching}", geomname1=name, geomname2=touching)
            for setting in CONTACT:
                setattr(pair, setting, getattr(with_plane[frozenset((body.ground, touching))], setting))


def ground_level(conditions: Conditions, places: np.ndarray) -> np.ndarray:
    """Return the height of the ground at places in the world, (..., 2) -> (...) [mm]; 0 on the plane."""
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
    """Return whether feet with centres in the world, (..., 3) [mm], are beyond the edges of the ground, (...).

    Only the kinds of ground in `WITH_ENDS` have edges.
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
    """Return how deep spherical feet with centres in the world, (..., 3) [mm], are in the ground, (...) [mm].

    The depth is MuJoCo's, along the normal of the contact; it is negative above the ground.
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
    """Return the greatest depth of each foot in the four bumps around it; no other bump reaches the foot."""
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
    """Return centres on a square grid, (bump, 2), random heights up to `ground_height`, and radii, (bump,) [mm]."""
    lengths = conditions.body.lengths
    along, across = BUMPS
    x = conditions.ground_at + lengths.highest_bump + lengths.bump_spacing * np.arange(along)
    y = lengths.bump_spacing * (np.arange(across) - (across - 1) / 2)
    heights = conditions.ground_height * np.random.default_rng(conditions.ground_seed).random(along * across)
    centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return centres, heights, (lengths.highest_bump**2 + heights**2) / (2 * heights)
