"""What a page is told of a recording: its steps in full, and poses, some of them, for the eye."""

import base64
from typing import Any

import mujoco
import numpy as np
import xarray as xr

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions, unusual
from hexmj.legs import LEGS
from hexmj.rendering.shapes import body_shape, ground_shape
from hexmj.replay.take import Take, support_on_ground

APART = 0.005
"""From one pose that is shown to the next [s]."""

MOST_POSES = 4000
"""In one page; those of a longer walk are farther apart."""

PLANNED = {"seconds": "f8", "velocity": "f4", "planned_margin": "f8", "planned_stance": "u1"}
MEASURED = {"measured_margin": "f8", "measured_stance": "u1"}
SHAPE = {"corners": "f4", "normals": "f4", "faces": "u4", "colour": "f4", "body": "u1"}
"""What is told as it is of a recording, of a physical insect's, and of a shape -> its type."""


def shown(recording: xr.Dataset, take: Take) -> dict[str, Any]:
    """A recording and its take as JSON can hold them.

    Margins and times are float64, as the recording has them; places and poses are float32.
    """
    compiled, body = compile_body(take.conditions), take.conditions.body
    every = max(1, round(APART / take.step), -(-len(take.qpos) // MOST_POSES))
    rows = np.unique(np.append(np.arange(0, len(take.qpos), every), len(take.qpos) - 1))
    poses, tips = _poses(compiled, take.qpos[rows])
    corners, level = _polygons(take, rows)
    return {
        "title": take.title,
        "physical": take.physical,
        "conditions": told_conditions(take.conditions, take.physical),
        "legs": LEGS,
        "vp": take.conditions.vp,
        "step": take.step,
        "happened": happened(take),
        "lost": _or_none(take.lost),
        "fell": _or_none(take.fell),
        "part": take.part,
        "plane": float(compiled.model.geom(body.ground).pos[2]),
        "gap": take.conditions.ground == "gap",
        "marks": {"tip": body.marks.tip, "outline": body.marks.outline, "centre": body.marks.rim[0]},
        **_packed_parts(recording, PLANNED),
        "rows": packed(rows, "i4"),
        "poses": packed(poses, "f4"),
        "tips": packed(tips, "f4"),
        "planned_tips": packed(take.planned_tip[rows], "f4"),
        "centre_of_mass": packed(take.centre_of_mass[rows], "f4"),
        "polygon": packed(corners, "f4"),
        "level": packed(level, "f4"),
        "body": _packed_parts(body_shape(compiled.model), SHAPE),
        "ground": _packed_parts(ground_shape(compiled), SHAPE),
    } | (_packed_parts(recording, MEASURED) if take.physical else {})


def told_conditions(conditions: Conditions, physical: bool) -> str:
    """What body walked, at which V_p, and under which conditions that are not the usual ones."""
    values = conditions.values()
    body = conditions.body.name.replace("_", " ")
    who = f"{body} in physics" if physical else f"the plan, shown by a {body} that follows it"
    values_told = (f"{name.replace('_', ' ')} {values[name]}" for name in unusual(values) if name != "vp")
    return ", ".join([who, f"V_p = {conditions.vp:g} mm/s", *values_told])


def happened(take: Take) -> str:
    """When stability was lost and when it fell, by the end of what is shown."""
    events = (take.lost, "stability first lost"), (take.fell, f"fell on {take.part.replace('_', ' ')}")
    told = [f"{what} at {1000.0 * seconds:.0f} ms" for seconds, what in events if seconds <= take.end]
    return ", ".join(told) or f"stability {'never lost' if take.lost == np.inf else 'not lost in this part'}"


def packed(values: Any, kind: str) -> dict[str, Any]:
    """An array as text: its type, little-endian, its shape, and its bytes in base64."""
    array = np.ascontiguousarray(values, dtype=f"<{kind}")
    return {"type": kind, "shape": array.shape, "bytes": base64.b64encode(array.tobytes()).decode()}


def _poses(compiled: CompiledBody, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places and quaternions of all bodies, (pose, body, 7), and the feet, (pose, leg, 3), in the world [mm]."""
    model, body = compiled.model, compiled.conditions.body
    data, feet = mujoco.MjData(model), [model.site(foot).id for foot in body.feet]
    poses, tips = np.empty((len(qpos), model.nbody, 7)), np.empty((len(qpos), 6, 3))
    for n, now in enumerate(qpos):
        data.qpos[:] = now
        mujoco.mj_kinematics(model, data)
        poses[n, :, :3], poses[n, :, 3:], tips[n] = data.xpos, data.xquat, data.site_xpos[feet]
    return poses, tips


def _polygons(take: Take, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Support polygons, (pose, 6, 2), NaN beyond their corners, and the ground below them, (pose,) [mm]."""
    corners, level = np.full((len(rows), 6, 2), np.nan), np.empty(len(rows))
    for n, row in enumerate(rows):
        polygon, level[n] = support_on_ground(
            take.conditions, take.feet[row], take.stance[row], take.centre_of_mass[row]
        )
        corners[n, : len(polygon)] = polygon
    return corners, level


def _packed_parts(whole: Any, kinds: dict[str, str]) -> dict[str, Any]:
    return {name: packed(getattr(whole, name), kind) for name, kind in kinds.items()}


def _or_none(seconds: float) -> float | None:
    return seconds if np.isfinite(seconds) else None
