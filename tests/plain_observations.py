"""Observations and rewards as one would write them: the reference for the compiled passes of the environments."""

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.environments.observing import Places, Planned
from hexmj.environments.task import Task, observation_bounds
from hexmj.stability import stability_margin


def plain_observations(
    places: Places, standing: np.ndarray, planned: Planned, compiled: CompiledBody, task: Task
) -> dict[str, np.ndarray]:
    """What some insects observe, each (n, ...) in its shape, by name; `standing` says which feet do, (n, leg)."""
    qpos, qvel, rotation, sensors = places
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
        "planned_stance": planned.stance,
        "planned_tips": planned.tips,
        "out_of_reach": planned.missed,
    }
    bounds = observation_bounds(compiled, task)
    return {name: np.clip(observed[name], low, high) for name, (low, high) in bounds.items()}


def plain_rewards(places: Places, fell: np.ndarray, task: Task) -> np.ndarray:
    """max(0, 1 - |v - c| / c) max(0, u), and 0 on a fall, (n,)."""
    off = np.abs(places.qvel[:, 0] - task.command) / task.command
    return np.maximum(1.0 - off, 0.0) * np.maximum(places.rotation[:, 2, 2], 0.0) * ~fell
