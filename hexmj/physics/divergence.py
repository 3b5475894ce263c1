"""A simulation that diverged is an error, never an outcome: its last good state can be saved and replayed.

`python -m hexmj.physics.divergence FILE` replays one.
"""

import json
import sys
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.mjcf import compile_body
from hexmj.body import ROOT_QPOS, STICK_INSECT, Body
from hexmj.conditions import Conditions
from hexmj.errors import InputError, SimulationError
from hexmj.files import replacing
from hexmj.physics.backend import Diverged, MujocoBatch
from hexmj.physics.fine_steps import FineSteps
from hexmj.rotations import lean

STATE = ("qpos", "qvel", "qacc_warmstart", "xfrc_applied")


def walk_error(error: Diverged, doing: str, time: float, conditions: Conditions) -> SimulationError:
    """The error of an insect that diverged while it was `doing` something, at a time [time units]."""
    state = error.state | {
        "conditions": np.array(json.dumps(conditions.values(), default=lambda number: number.item()))
    }
    sentence = f"start {error.start} diverged while {doing}, at {time:.4g} time units: {error.kinds}"
    return SimulationError(sentence, state, f"diverged-start-{error.start}.npz")


def save_state(error: SimulationError, folder: Path) -> Path:
    """Write the last good state of an error that has one into a folder; `replay` reads it.

    Raises:
        InputError: it cannot be written.
    """
    path = folder / error.file_name
    with replacing(path) as part:
        np.savez(part, allow_pickle=False, **error.state)
    return path


def replay(path: Path | str, body: Body = STICK_INSECT) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A written state of divergence of a body, ready to step: set ``data.ctrl`` from the file's `ctrl`, (substep,
    actuator).

    Raises:
        InputError: it cannot be read, is damaged, or is of another body.
    """
    _, compiled, data = _read(path, body)
    return compiled.model, data


def replayed(path: Path | str, body: Body = STICK_INSECT) -> np.ndarray:
    """What a written state does under its controls, step by step and finely as it did.

    Returns:
        Positions after each physics step, (step, position).

    Raises:
        Diverged: it does so again.
        InputError: it cannot be read, is damaged, or is of another body.
    """
    saved, compiled, _ = _read(path, body)
    only, control = np.array([0]), saved["ctrl"][np.newaxis]
    batch = MujocoBatch(compiled, 1, threads=1)
    batch.put_back(saved)
    if "substeps" in saved:  # of a walk that exploded, from the beginning of a step of the plan on
        after = FineSteps.of(batch, int(saved["substeps"]), compiled).take(only, control)["after"]
    else:
        after = batch.roll(only, control, 1).after
    return after[0, :, : compiled.model.nq]


def _read(path: Path | str, body: Body) -> tuple[dict[str, np.ndarray], CompiledBody, mujoco.MjData]:
    """A written state, the body with its conditions, time step and contacts, and its data in that state."""
    try:
        with np.load(path) as file:
            saved = dict(file)
        conditions: dict[str, Any] = json.loads(str(saved["conditions"]))
        compiled = compile_body(Conditions(body=body, **conditions), float(saved["timestep"]))
        compiled.model.pair_solref[:, 0] = saved["contact"]
        data = mujoco.MjData(compiled.model)
        for name in STATE:
            getattr(data, name)[:] = saved[name]
    except (KeyError, OSError, ValueError) as error:
        raise InputError(f"{path} is no state of the body {body.name!r}: {error}") from None
    return saved, compiled, data


def main(path: str) -> None:
    """Print how a written state of the stick insect goes on: height and tilt of its root after each physics step."""
    try:
        for step, qpos in enumerate(replayed(path)):
            print(f"step {step + 1}: {qpos[2]:.4g} mm high, tilted by {lean(qpos[3:ROOT_QPOS])[1]:.3g} rad")
    except Diverged as error:
        print(f"it diverged: {error.kinds}")
    except InputError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    parser = ArgumentParser("python -m hexmj.physics.divergence", description=main.__doc__)
    parser.add_argument("path", help="a state that a simulation left, .npz")
    main(parser.parse_args().path)
