"""The ground: a plane, or what lies ahead on it.  Only feet and trunk touch it, as listed pairs."""

import mujoco
import numpy as np

from hexmj.physics.body import SHORTEST_LEG, Body

WIDE = 200.0
"""Half the width of everything that lies ahead [mm]."""
FAR = 1000.0
"""Where it ends, if it has no length of its own [mm]."""
CELL = 5.0
"""Distance of the knots of rough ground [mm], a quarter of a step."""


def lay_ground(spec: mujoco.MjSpec, body: Body, legs: tuple[str, ...], trunk: tuple[str, ...]) -> None:
    """Add what lies ahead to a spec of the insect on its plane."""
    near, length, height = body.ground_at, body.ground_length, body.ground_height
    pieces = []
    if body.ground == "step":
        pieces = [_box(spec, "step", near, FAR, height)]
    elif body.ground == "hurdle":
        pieces = [_box(spec, "hurdle", near, near + length, height)]
    elif body.ground == "gap":
        spec.geom("ground").pos[2] = -SHORTEST_LEG
        pieces = [_box(spec, "bank", -FAR, near, 0.0), _box(spec, "far_bank", near + length, near + length + FAR, 0.0)]
    elif body.ground == "rough":
        pieces = [_bumps(spec, body)]
    for piece in pieces:
        for touching in (*trunk, *(f"{leg}_foot" for leg in legs)):
            spec.add_pair(name=f"{piece}_{touching}", geomname1=piece, geomname2=touching)


def _box(spec: mujoco.MjSpec, name: str, begin: float, end: float, top: float) -> str:
    """A block from `begin` to `end` along the way whose upper side lies at `top` [mm]."""
    half = (top + SHORTEST_LEG) / 2
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[(end - begin) / 2, WIDE, half],
        pos=[(begin + end) / 2, 0.0, top - half],
        contype=0,
        conaffinity=0,
        material="ground",
    )
    return name


def _bumps(spec: mujoco.MjSpec, body: Body) -> str:
    """Heights drawn uniformly at knots `CELL` apart, from the plane up to the height, rising over the first two."""
    rows, columns = int(2 * WIDE / CELL) + 1, int((FAR - body.ground_at) / CELL) + 1
    heights = np.random.default_rng(body.ground_seed).random((rows, columns))
    heights[:, :2] *= (0.0, 0.5)
    spec.add_hfield(
        name="bumps",
        nrow=rows,
        ncol=columns,
        size=[(columns - 1) * CELL / 2, WIDE, body.ground_height, SHORTEST_LEG],
        userdata=heights.ravel(),
    )
    spec.worldbody.add_geom(
        name="bumps",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="bumps",
        pos=[body.ground_at + (columns - 1) * CELL / 2, 0.0, 0.0],
        contype=0,
        conaffinity=0,
        material="ground",
    )
    return "bumps"
