"""The ground: a plane with obstacles on it. Contact pairs let only the feet and the trunk touch it.

`Conditions.ground` is the kind of ground; `ground_height`, `ground_at`, `ground_length` and `ground_seed` describe it.
"""

import mujoco
import numpy as np

from hexmj.conditions import STAIRS, Conditions

BUMPS = (15, 9)
"""Numbers of bumps along and across the direction of walking: at 12 mm spacing they cover 180 by 108 mm."""

LOOK = {"contype": 0, "conaffinity": 0, "rgba": (0.78, 0.84, 0.90, 1.0)}
"""Settings of an obstacle's geom: contacts only in pairs, and a tint that distinguishes it from the plane."""

CONTACT = ("condim", "friction", "solref", "solimp")
"""Settings that contact pairs with obstacles copy from the contact pairs with the plane."""


def lay_ground(spec: mujoco.MjSpec, conditions: Conditions) -> None:
    """Add obstacles, and their contact pairs with feet and trunk, to the spec of a body on its plane."""
    body, lengths, kinds = conditions.body, conditions.body.lengths, mujoco.mjtGeom
    pieces = {}  # name -> geom type, size and position
    for i, (begin, end, top) in enumerate(blocks(conditions)):
        half = (top + lengths.shortest_leg) / 2
        size = (end - begin) / 2, lengths.ground_half_width, half
        pieces[f"block_{i}"] = kinds.mjGEOM_BOX, size, ((begin + end) / 2, 0.0, top - half)
    spec.geom(body.ground).pos[2] += _floor(conditions)
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


def blocks(conditions: Conditions) -> list[tuple[float, float, float]]:
    """Return where each block of the ground begins and ends in the direction of walking, and its height [mm]."""
    near, length, height = conditions.ground_at, conditions.ground_length, conditions.ground_height
    far = conditions.body.lengths.ground_reach
    match conditions.ground:
        case "step":
            return [(near, near + far, height)]
        case "stairs":
            return [(near + i * length, near + far, (i + 1) * height) for i in range(STAIRS)]
        case "hurdle":
            return [(near, near + length, height)]
        case "gap":
            return [(-far, near, 0.0), (near + length, near + length + far, 0.0)]
    return []


def ground_level(conditions: Conditions, places: np.ndarray) -> np.ndarray:
    """Return the height of the ground at places in the world, (..., 2) -> (...) [mm]; 0 on the plane."""
    x = places[..., 0]
    if conditions.ground == "rough":
        centres, heights, radii = _bumps(conditions)
        off = np.linalg.norm(places[..., None, :] - centres, axis=-1)
        caps = np.sqrt(np.maximum(radii**2 - off**2, 0.0)) - (radii - heights)
        return np.maximum(caps.max(axis=-1), 0.0)
    level = np.full(x.shape, _floor(conditions))
    for begin, end, top in blocks(conditions):
        level = np.where((x > begin) & (x < end), np.maximum(level, top), level)
    return level


def beyond_the_ground(conditions: Conditions, feet: np.ndarray) -> np.ndarray:
    """Return whether feet with centres in the world, (..., 3) [mm], are beyond the edges of the ground, (...).

    Only ground with blocks has edges; behind a hurdle and before other obstacles, the plane goes on.
    """
    x, y, beyond = feet[..., 0], feet[..., 1], np.zeros(feet.shape[:-1], dtype=bool)
    if not (pieces := blocks(conditions)):
        return beyond
    first, last = pieces[0][0], max(end for _, end, _ in pieces)
    aside = (np.abs(y) > conditions.body.lengths.ground_half_width) & (x > first) & (x < last)
    return aside | ((x > last) & (conditions.ground != "hurdle")) | ((x < first) & (conditions.ground == "gap"))


def _floor(conditions: Conditions) -> float:
    """Return the height of the plane [mm]: 0, or below the banks of a gap."""
    return -conditions.body.lengths.shortest_leg if conditions.ground == "gap" else 0.0


def depth_in_ground(conditions: Conditions, feet: np.ndarray, radius: float) -> np.ndarray:
    """Return how deep spherical feet with centres in the world, (..., 3) [mm], are in the ground, (...) [mm].

    The depth is MuJoCo's, along the normal of the contact; it is negative above the ground.
    """
    x, z = feet[..., 0], feet[..., 2]
    if conditions.ground == "rough":
        return np.maximum(radius - z, _depth_in_bumps(conditions, feet, radius))
    height = z - _floor(conditions)
    for begin, end, top in blocks(conditions):
        outside, above = np.maximum(begin - x, x - end), z - top
        corner = np.hypot(np.maximum(outside, 0.0), np.maximum(above, 0.0))
        height = np.minimum(height, corner + np.minimum(np.maximum(outside, above), 0.0))
    return radius - height


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
