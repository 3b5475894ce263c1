"""A simulation that diverged is an error, never an outcome: its last good state can be saved and replayed."""

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.description import Body
from hexmj.bodies.loading import compile_body
from hexmj.bodies.stick_insect import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.errors import InputError, SimulationError
from hexmj.files import read_sealed, sealed, write_whole
from hexmj.physics.backend import Diverged


def walk_error(error: Diverged, doing: str, time: float, conditions: Conditions) -> SimulationError:
    """The error of an insect that diverged while it was `doing` something, at a time [time units]."""
    state = error.state | {"conditions": np.array(json.dumps(conditions.flat(), default=lambda number: number.item()))}
    sentence = f"start {error.start} diverged while {doing}, at {time:.4g} time units: {error.kinds}"
    return SimulationError(sentence, state, f"diverged-start-{error.start}.npz")


def save_state(error: SimulationError, folder: Path) -> Path:
    """Write the last good state of an error that has one into a folder; `replay` reads it.

    Raises:
        InputError: it cannot be written.
    """
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **error.state)
    return write_whole((folder / error.file_name).resolve(), sealed(content.getvalue()))


def replay(path: Path | str, body: Body = STICK_INSECT) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A written state of divergence of a body, ready to step: set ``data.ctrl`` from the file's `ctrl`, (substep,
    actuator).

    Raises:
        InputError: it cannot be read, is damaged, or is of another body.
    """
    if (content := read_sealed(Path(path))) is None:
        raise InputError(f"{path} is damaged, or no state that a simulation left; expected one of this version")
    try:
        return _set(content, body)
    except (KeyError, ValueError) as error:
        raise InputError(f"{path} is no state of the body {body.name!r}: {error}") from None


def _set(content: bytes, body: Body) -> tuple[mujoco.MjModel, mujoco.MjData]:
    with np.load(io.BytesIO(content)) as saved:
        conditions: dict[str, Any] = json.loads(str(saved["conditions"]))
        model = compile_body(replace(Conditions.of(**conditions), body=body), float(saved["timestep"])).model
        model.pair_solref[:, 0] = saved["contact"]
        data = mujoco.MjData(model)
        for name in ("qpos", "qvel", "qacc_warmstart", "xfrc_applied"):
            getattr(data, name)[:] = saved[name]
    return model, data
