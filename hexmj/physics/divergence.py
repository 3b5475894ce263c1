"""A simulation that diverged is an error, never an outcome: its last good state is written, to be replayed."""

import json
from dataclasses import asdict
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch

from hexmj.errors import SimulationError
from hexmj.physics import insect
from hexmj.physics.body import Body


def raise_if_diverged(
    batch: Batch, ids: np.ndarray, time: float, speeds: np.ndarray | None, state: dict[str, np.ndarray]
) -> None:
    """A MuJoCo warning or a number that is not finite in one of `ids` ends everything; its state is written.

    `speeds` are the velocities V_r of all starts, none while they settle.
    """
    warned = batch.warning[ids, :, 1] > 0
    broken = ~np.isfinite(batch.bind("qpos")[ids]).all(axis=1)
    failed = np.flatnonzero(warned.any(axis=1) | broken)
    if len(failed) == 0:
        return
    i = failed[0]
    kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(warned[i])] or ["a state that is not finite"]
    path = Path(f"diverged-start-{ids[i]}.npz").resolve()
    when = "while settling" if speeds is None else f"while walking at V = {speeds[ids[i]]:g}"
    model = batch.get_model(ids[i])
    saved = {name: values[i] for name, values in state.items()}
    saved |= {"xfrc_applied": batch.bind("xfrc_applied")[ids[i]], "contact": model.pair_solref[:, 0]}
    saved["timestep"] = np.array(model.opt.timestep)
    try:
        np.savez(path, allow_pickle=False, **saved, body=json.dumps(asdict(insect.body_of(model))))
        written = f"its last good state is in {path} (hexmj.physics.divergence.replay)"
    except OSError as error:
        written = f"its last good state could not be written to {path}: {error.strerror}"
    raise SimulationError(f"start {ids[i]} diverged {when}, at {time:.4g} time units: {', '.join(kinds)}; {written}")


def replay(path: Path | str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A written state of divergence, ready to step: set ``data.ctrl`` from the file's `ctrl`, (substep, actuator)."""
    with np.load(path) as saved:
        model = insect.load(float(saved["timestep"]), Body(**json.loads(str(saved["body"]))))
        model.pair_solref[:, 0] = saved["contact"]
        data = mujoco.MjData(model)
        for name in ("qpos", "qvel", "qacc_warmstart", "xfrc_applied"):
            getattr(data, name)[:] = saved[name]
    return model, data
