"""Conditions of any body, its model at home, and what differs between two models."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.body import STICK_INSECT, Body
from hexmj.conditions import Conditions

NAMES = ("name", "text", "paths", "nnames", "nbuffer")
"""Beginnings of what holds nothing but names in a model, and its size."""


def conditions(body: Body = STICK_INSECT, **values: Any) -> Conditions:
    """The usual conditions of a body but for some."""
    return Conditions(body=body, **values)


def arrays(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """All that a model holds but names, its options among it."""
    held = {}
    for place, of in (("", model), ("opt.", model.opt), ("stat.", model.stat)):
        for name in dir(of):
            value = None if name.startswith(("_", *NAMES)) else getattr(of, name)
            if isinstance(value, (np.ndarray, int, float)):
                held[place + name] = np.array(value)
    return held


def differences(one: mujoco.MjModel, other: mujoco.MjModel) -> list[str]:
    """What is not the same, to the bit."""
    a, b = arrays(one), arrays(other)
    assert len(a) > 400 and a.keys() == b.keys()
    return [name for name in a if a[name].shape != b[name].shape or a[name].tobytes() != b[name].tobytes()]


def at_home(compiled: CompiledBody) -> mujoco.MjData:
    """The compiled body in posture home, its servos at rest."""
    data = mujoco.MjData(compiled.model)
    data.qpos[:] = compiled.home
    data.ctrl[compiled.columns.ctrl] = compiled.home[compiled.columns.qpos]
    mujoco.mj_forward(compiled.model, data)
    return data


def changed_body(folder: Path, changes: dict[str, str]) -> Body:
    """The stick insect with some words of its MJCF replaced."""
    text = STICK_INSECT.mjcf.read_text()
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    (file := folder / "changed.xml").write_text(text)
    return replace(STICK_INSECT, name="changed", mjcf=file)
