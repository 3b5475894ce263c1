"""Observations and rewards as one would write them: the reference for the compiled passes of the environments."""

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.environments.task import Task, observation_shapes
from hexmj.stability import stability_margin

State = tuple[np.ndarray, ...]


def plain_observations(
    state: State, standing: np.ndarray, planned: State, compiled: CompiledBody, task: Task
) -> dict[str, np.ndarray]:
    """Return the observations of n insects, from `Walkers.state`, standing feet, (n, leg), and `Walkers.planned`."""
    (qpos, qvel, rotation, sensors), (stance, tips, missed) = state, planned
    columns = compiled.columns
    feet = sensors[:, columns.foot].reshape(-1, 6, 3)
    around = feet - sensors[:, np.newaxis, columns.centre_of_mass]
    margin = stability_margin(around[:, :, :2], standing, threads=1)
    corners, radii = compiled.trunk_corners
    above_root = (corners @ rotation[:, 2, :, np.newaxis])[..., 0]
    heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    cosine, sine, x, y = np.cos(heading), np.sin(heading), qvel[:, 0], qvel[:, 1]
    observed = {
        "joint_angles": qpos[:, columns.qpos],
        "joint_velocities": qvel[:, columns.qvel],
        "orientation": qpos[:, 3:7],
        "velocity": np.stack([cosine * x + sine * y, cosine * y - sine * x, qvel[:, 2]], axis=1),
        "angular_velocity": qvel[:, 3:6],
        "clearance": (qpos[:, 2:3] + above_root - radii).min(axis=1)[:, np.newaxis],
        "tips": (feet - qpos[:, np.newaxis, :3]) @ rotation,
        "contact": standing.astype(float),
        "margin": np.maximum(margin, compiled.body.lengths.no_foot_margin)[:, np.newaxis],
        "command": np.full((len(qpos), 1), task.command),
        "planned_stance": stance,
        "planned_tips": tips,
        "out_of_reach": missed,
    }
    return {name: observed[name] for name in observation_shapes(compiled, task)}


def plain_rewards(state: State, fell: np.ndarray, task: Task) -> np.ndarray:
    """max(0, 1 - |v - c| / c) max(0, u), and 0 on a fall, (n,)."""
    _, qvel, rotation, _ = state
    off = np.abs(qvel[:, 0] - task.command) / task.command
    return np.maximum(1.0 - off, 0.0) * np.maximum(rotation[:, 2, 2], 0.0) * ~fell
