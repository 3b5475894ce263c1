"""The ground: a plane, or what lies ahead on it.  Only feet and trunk touch it, as listed pairs."""

import mujoco
import numpy as np

from hexmj.physics.body import HIGHEST_BUMP, SHORTEST_LEG, Body

WIDE = 200.0
"""Half the width of everything that lies ahead [mm]."""
FAR = 1000.0
"""How far steps and the banks of a gap reach [mm]."""
SPACING = 12.0
"""Distance of the bumps' centres on rough ground [mm]; neighbours leave only small gaps."""
BUMPS = (15, 9)
"""Bumps along the way and across it, a field of 180 by 108 mm."""
LOOK = {"contype": 0, "conaffinity": 0, "material": "ground", "rgba": (0.78, 0.84, 0.90, 1.0)}
"""Of everything that lies ahead: the plane's colours, tinted to tell it from the plane."""


def lay_ground(spec: mujoco.MjSpec, body: Body, legs: tuple[str, ...], trunk: tuple[str, ...]) -> None:
    """Add what lies ahead to a spec of the insect on its plane."""
    near, length, height = body.ground_at, body.ground_length, body.ground_height
    pieces = []
    if body.ground == "step":
        pieces = [_box(spec, "step", near, near + FAR, height)]
    elif body.ground == "hurdle":
        pieces = [_box(spec, "hurdle", near, near + length, height)]
    elif body.ground == "gap":
        spec.geom("ground").pos[2] = -SHORTEST_LEG
        pieces = [_box(spec, "bank", -FAR, near, 0.0), _box(spec, "far_bank", near + length, near + length + FAR, 0.0)]
    elif body.ground == "rough":
        pieces = _caps(spec, body)
    for piece in pieces:
        for touching in (*trunk, *(f"{leg}_foot" for leg in legs)):
            spec.add_pair(name=f"{piece}_{touching}", geomname1=piece, geomname2=touching)


def ground_level(body: Body, places: np.ndarray) -> np.ndarray:
    """Height of the ground at places in the world, (..., 2) -> (...) [mm]; 0 where nothing lies ahead."""
    x = places[..., 0]
    if body.ground == "rough":
        centres, heights, radii = _bumps(body)
        off = np.linalg.norm(places[..., None, :] - centres, axis=-1)
        caps = np.sqrt(np.maximum(radii**2 - off**2, 0.0)) - (radii - heights)
        return np.maximum(caps.max(axis=-1), 0.0)
    end = np.inf if body.ground == "step" else body.ground_at + body.ground_length
    height = {"flat": 0.0, "gap": -SHORTEST_LEG}.get(body.ground, body.ground_height)
    return np.where((x > body.ground_at) & (x < end), height, 0.0)


def depth_in_ground(body: Body, feet: np.ndarray, radius: float) -> np.ndarray:
    """How deep spheres are in the ground, as MuJoCo measures it along the normal; negative above it.

    Args:
        body: has the ground.
        feet: their centres in the world, (..., 3) [mm].
        radius: of the spheres [mm].

    Returns:
        (...,) [mm].
    """
    x, z = feet[..., 0], feet[..., 2]
    near, length = body.ground_at, body.ground_length
    if body.ground == "flat":
        return radius - z
    if body.ground == "rough":
        return np.maximum(radius - z, _depth_in_bumps(body, feet, radius))
    off_middle = np.abs(x - near - length / 2)
    outside = {"step": near - x, "hurdle": off_middle - length / 2, "gap": length / 2 - off_middle}[body.ground]
    above = z - (0.0 if body.ground == "gap" else body.ground_height)
    from_block = np.hypot(np.maximum(outside, 0.0), np.maximum(above, 0.0)) + np.minimum(np.maximum(outside, above), 0)
    floor = -SHORTEST_LEG if body.ground == "gap" else 0.0
    return radius - np.minimum(from_block, z - floor)


def _depth_in_bumps(body: Body, feet: np.ndarray, radius: float) -> np.ndarray:
    """The same in the caps whose centres surround a foot, four at most: no other reaches it."""
    centres, heights, radii = (one.reshape(*BUMPS, -1) for one in _bumps(body))
    corner = np.floor((feet[..., :2] - centres[0, 0]) / SPACING).astype(int)
    depth = np.full(feet.shape[:-1], -np.inf)
    for along, across in ((0, 0), (0, 1), (1, 0), (1, 1)):
        i, j = (np.clip(corner[..., k] + step, 0, BUMPS[k] - 1) for k, step in enumerate((along, across)))
        below = (heights - radii)[i, j]
        centre = np.concatenate([centres[i, j], below], axis=-1)
        depth = np.maximum(depth, radii[i, j, 0] + radius - np.linalg.norm(feet - centre, axis=-1))
    return depth


def _box(spec: mujoco.MjSpec, name: str, begin: float, end: float, top: float) -> str:
    """A block from `begin` to `end` along the way whose upper side lies at `top` [mm]."""
    half = (top + SHORTEST_LEG) / 2
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[(end - begin) / 2, WIDE, half],
        pos=[(begin + end) / 2, 0.0, top - half],
        **LOOK,
    )
    return name


def _caps(spec: mujoco.MjSpec, body: Body) -> list[str]:
    """Caps of spheres that lie under the plane.

    However fast a foot lands, a sphere pushes it up and out again; the prisms of a height field push a foot that is
    deeper than its distance from their sides sideways into the next, and there it stays.
    """
    names = []
    for i, ((x, y), height, radius) in enumerate(zip(*_bumps(body), strict=True)):
        names.append(f"bump_{i}")
        spec.worldbody.add_geom(
            name=names[-1],
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0.0, 0.0],
            pos=[x, y, height - radius],
            **LOOK,
        )
    return names


def _bumps(body: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres on a square grid, (bump, 2), heights drawn uniformly up to the height, and radii, (bump,) [mm]."""
    along, across = BUMPS
    x = body.ground_at + HIGHEST_BUMP + SPACING * np.arange(along)
    y = SPACING * (np.arange(across) - (across - 1) / 2)
    heights = body.ground_height * np.random.default_rng(body.ground_seed).random(along * across)
    centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return centres, heights, (HIGHEST_BUMP**2 + heights**2) / (2 * heights)
