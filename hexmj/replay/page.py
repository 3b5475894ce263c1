"""HTML page that plays recordings: one file, which loads nothing from the network or other files."""

import base64
import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import xarray as xr

from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions, unusual
from hexmj.errors import InputError
from hexmj.files import write_text
from hexmj.legs import LEGS
from hexmj.rendering.shapes import body_shapes, ground_shape, joined
from hexmj.replay.take import Take, takes_of

POSE_INTERVAL = 0.005
"""Time between two poses of the body in a page [s]."""

MOST_POSES = 4000
"""Maximum number of poses in a page; in a long walk, the time between two poses is longer than `POSE_INTERVAL`."""

PLANNED = {"seconds": "f8", "velocity": "f4", "planned_margin": "f8", "planned_stance": "u1"}
GROUNDED = {"grounded_margin": "f8", "grounded_stance": "u1"}
SHAPE = {"corners": "f4", "normals": "f4", "faces": "u4", "colour": "f4", "body": "u1"}
"""Array in a page -> its type: arrays of every recording, of a physical walk only, and of a `Shape`."""


def page(recordings: Sequence[xr.Dataset], path: Path | str, *, body: Body = STICK_INSECT) -> Path:
    """Write one recording, or two side by side with one clock, as a page that plays in any current browser.

    The page draws the walk in 3D with its support polygon, centre of mass, planned and simulated tips. Beside it are
    the footfall diagram and the stability margin with the recording's own values.

    Args:
        recordings: one or two recordings.
        path: HTML file to write.
        body: description of the recorded body.

    Returns:
        The path.

    Raises:
        InputError: no recording, or a recording without a pose or of another body.
    """
    return write_text(path, page_text(recordings, body))


def page_text(recordings: Sequence[xr.Dataset], body: Body = STICK_INSECT) -> str:
    """Return the HTML text that `page` writes for one or two recordings."""
    takes = takes_of(recordings, body)
    if len(takes) > 2:
        raise InputError(f"{len(takes)} recordings; a page plays one or two")
    data = [_page_data(recording, take) for recording, take in zip(recordings, takes, strict=True)]
    escapes = {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"}  # titles cannot end the script
    recordings_json = json.dumps(data, allow_nan=False).translate(str.maketrans(escapes))
    parts = {"STYLE": _asset("page.css"), "SCRIPT": _asset("page.js"), "RECORDINGS": recordings_json}
    text = _asset("page.html")
    for name, part in parts.items():
        text = text.replace(f"<!--{name}-->", part)
    return text


def _page_data(recording: xr.Dataset, take: Take) -> dict[str, Any]:
    """Return a recording for the page's JSON: times and margins of all steps, and poses of the steps `rows`."""
    conditions, body = take.conditions, take.conditions.body
    compiled = compile_body(conditions)
    model = compiled.model
    every = max(1, round(POSE_INTERVAL / take.step), -(-len(take.qpos) // MOST_POSES))
    rows = np.unique(np.append(np.arange(0, len(take.qpos), every), len(take.qpos) - 1))
    polygons, levels = zip(*(take.support(row) for row in rows), strict=True)
    padded = [np.pad(corners, ((0, 6 - len(corners)), (0, 0)), constant_values=np.nan) for corners in polygons]
    return {
        "title": take.title,
        "physical": take.physical,
        "conditions": _conditions_text(conditions, take.physical),
        "legs": LEGS,
        "vp": conditions.vp,
        "step": take.step,
        "happened": _happened(take),
        "lost": take.lost if np.isfinite(take.lost) else None,
        "fell": take.fell if np.isfinite(take.fell) else None,
        "part": take.part,
        "plane": float(model.geom(body.ground).pos[2]),
        "gap": conditions.ground == "gap",
        "marks": {"tip": body.marks.tip, "outline": body.marks.outline, "centre": body.marks.rim[0]},
        **_packed_parts(recording, PLANNED),
        "rows": _packed(rows, "i4"),
        "poses": _packed(_poses(model, take.qpos[rows]), "f4"),
        "tips": _packed(recording["tip"].values[rows], "f4"),
        "planned_tips": _packed(take.planned_tip[rows], "f4"),
        "centre_of_mass": _packed(take.centre_of_mass[rows], "f4"),
        "polygon": _packed(padded, "f4"),
        "level": _packed(levels, "f4"),
        "body": _packed_parts(joined(body_shapes(model)), SHAPE),
        "ground": _packed_parts(ground_shape(compiled), SHAPE),
    } | (_packed_parts(recording, GROUNDED) if take.physical else {})


def _conditions_text(conditions: Conditions, physical: bool) -> str:
    """Return a line that names the body, V_p and the conditions that differ from the defaults."""
    values, name = conditions.values(), conditions.body.name.replace("_", " ")
    shown = f"{name} in physics" if physical else f"the plan, shown by a {name} that follows it"
    changed = (f"{name.replace('_', ' ')} {values[name]}" for name in unusual(values) if name != "vp")
    return ", ".join([shown, f"V_p = {conditions.vp:g} mm/s", *changed])


def _happened(take: Take) -> str:
    """Return a line with the times of the first loss of stability and the fall that the recording contains."""
    events = (take.lost, "stability first lost"), (take.fell, f"fell on {take.part.replace('_', ' ')}")
    texts = [f"{event} at {1000.0 * seconds:.0f} ms" for seconds, event in events if seconds <= take.end]
    return ", ".join(texts) or f"stability {'never lost' if take.lost == np.inf else 'not lost in this part'}"


def _poses(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """Return positions [mm] and quaternions of MuJoCo's bodies, (pose, body, 7)."""
    data, poses = mujoco.MjData(model), np.empty((len(qpos), model.nbody, 7))
    for n, data.qpos[:] in enumerate(qpos):
        mujoco.mj_kinematics(model, data)
        poses[n, :, :3], poses[n, :, 3:] = data.xpos, data.xquat
    return poses


def _packed(values: Any, kind: str) -> dict[str, Any]:
    """Return an array as JSON: its dtype, shape, and little-endian bytes in base64."""
    array = np.ascontiguousarray(values, dtype=f"<{kind}")
    return {"type": kind, "shape": array.shape, "bytes": base64.b64encode(array.tobytes()).decode()}


def _packed_parts(source: Any, kinds: dict[str, str]) -> dict[str, Any]:
    return {name: _packed(getattr(source, name), kind) for name, kind in kinds.items()}


def _asset(name: str) -> str:
    return files("hexmj.replay").joinpath("assets", name).read_text(encoding="utf-8")
