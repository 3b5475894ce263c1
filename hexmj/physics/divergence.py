"""A simulation that diverged is an error, never an outcome: its last good state can be saved and replayed.

`python -m hexmj.physics.divergence FILE` replays one.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.description import ROOT_QPOS, Body
from hexmj.bodies.loading import compile_body
from hexmj.bodies.stick_insect import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.errors import SimulationError
from hexmj.physics.backend import Diverged, MujocoBatch
from hexmj.physics.fine_steps import FineSteps
from hexmj.rotations import lean


def walk_error(error: Diverged, doing: str, time: float, conditions: Conditions) -> SimulationError:
    """The error of an insect that diverged while it was `doing` something, at a time [time units]."""
    state = error.state | {"conditions": np.array(json.dumps(conditions.flat(), default=lambda number: number.item()))}
    sentence = f"start {error.start} diverged while {doing}, at {time:.4g} time units: {error.kinds}"
    return SimulationError(sentence, state, f"diverged-start-{error.start}.npz")


def save_state(error: SimulationError, folder: Path) -> Path:
    """Write the last good state of an error that has one into a folder; `replay` reads it.

    Raises:
        OSError: it cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = (folder / error.file_name).resolve()
    np.savez(path, allow_pickle=False, **error.state)
    return path


def replay(path: Path | str, body: Body = STICK_INSECT) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A written state of divergence of a body, ready to step: set ``data.ctrl`` from the file's `ctrl`, (substep,
    actuator)."""
    saved = _saved(path)
    model = _compiled(saved, body).model
    data = mujoco.MjData(model)
    for name in ("qpos", "qvel", "qacc_warmstart", "xfrc_applied"):
        getattr(data, name)[:] = saved[name]
    return model, data


def replayed(path: Path | str, body: Body = STICK_INSECT) -> np.ndarray:
    """What a written state does under its controls, step by step and finely as it did.

    Returns:
        Positions after each physics step, (step, position).

    Raises:
        Diverged: it does so again.
    """
    saved = _saved(path)
    compiled, only, control = _compiled(saved, body), np.array([0]), saved["ctrl"][np.newaxis]
    batch = MujocoBatch(compiled, 1, threads=1)
    batch.put_back(saved)
    if "substeps" in saved:  # of a walk that exploded, from the beginning of a step of the plan on
        after = FineSteps.of(batch, int(saved["substeps"]), compiled).take(only, control)["after"]
    else:
        after = batch.roll(only, control).after
    return after[0, :, : compiled.model.nq]


def _saved(path: Path | str) -> dict[str, np.ndarray]:
    with np.load(path) as saved:
        return dict(saved)


def _compiled(saved: dict[str, np.ndarray], body: Body) -> CompiledBody:
    """The body with the conditions, the time step and the contacts of a written state."""
    conditions: dict[str, Any] = json.loads(str(saved["conditions"]))
    compiled = compile_body(replace(Conditions.of(**conditions), body=body), float(saved["timestep"]))
    compiled.model.pair_solref[:, 0] = saved["contact"]
    return compiled


def main(path: str) -> None:
    """Print how a written state of the stick insect goes on: height and tilt of its root after each physics step."""
    try:
        for step, qpos in enumerate(replayed(path)):
            print(f"step {step + 1}: {qpos[2]:.4g} mm high, tilted by {lean(qpos[3:ROOT_QPOS])[1]:.3g} rad")
    except Diverged as error:
        print(f"it diverged: {error.kinds}")


if __name__ == "__main__":
    main(sys.argv[1])
