"""What a chunk of a physical walk shows at the plan's steps: the measured walk, and the feet on the ground."""

from typing import Any

import numpy as np

from hexmj.jitted import jitted
from hexmj.physics.drive import Chunk
from hexmj.physics.settling import Settled
from hexmj.rotations import matrix
from hexmj.walks import Walk


def measured_walk(
    chunk: Chunk, settled: Settled, rows: np.ndarray | None = None
) -> tuple[np.ndarray, Walk, np.ndarray]:
    """The measured walk at the plan's steps that fall within a chunk.

    Args:
        chunk: of `drive.drive`.
        settled: what it began with.
        rows: which of the chunk's starts, (n,); all unless given.

    Returns:
        Columns of the chunk's substeps, (step,), the walk of these starts, and the centre of mass in the
        world, (step, n, 3) [mm].  The walk is NaN, and no foot stands, after a fall; its velocities, which are the
        plan's, are NaN throughout.
    """
    m, stride, columns = settled.substeps, settled.stride, settled.compiled.columns
    rows = np.arange(len(chunk.ids)) if rows is None else rows
    substep = np.arange(chunk.qpos.shape[1])
    shown = substep[((chunk.first + substep) % m == 0) & (chunk.first + substep > 0)]
    shape = len(shown), len(rows)
    x, y, stance = np.full((*shape, 6), np.nan), np.full((*shape, 6), np.nan), np.zeros((*shape, 6), dtype=bool)
    centre, places = np.full((*shape, 3), np.nan), (columns.foot.start, columns.centre_of_mass.start)
    _look((chunk.qpos, chunk.sensors, chunk.standing, chunk.valid), rows, shown, places, (x, y, stance, centre))
    time, velocity = (chunk.first + shown) // m * stride.dt, np.full(shape, np.nan)
    walk = Walk(time, velocity, x - np.array(stride.geometry.origin), y, stance, stride.geometry)
    return shown, walk, centre


def feet_on_ground(chunk: Chunk, settled: Settled, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How high the feet are above the ground [mm], and what it carries them with, adhesion taken off [g mm/s^2], both
    (step, n, leg).

    They are those in some columns of a chunk's substeps, (step,); NaN after a fall.
    """
    sensors, compiled = chunk.sensors[:, columns], settled.compiled
    feet = sensors[..., compiled.columns.foot].reshape(*sensors.shape[:2], 6, 3)
    shown = (columns < chunk.valid[:, None])[..., None]
    values = -compiled.depth(feet), chunk.load[:, columns]
    height, load = (np.where(shown, one, np.nan).swapaxes(0, 1) for one in values)
    return height, load


@jitted
def _look(chunk: Any, rows: Any, shown: Any, places: Any, walk: Any) -> None:
    """Feet ahead of and beside the centre of mass, seen along the root's heading, up to the fall."""
    qpos, sensors, standing, valid = chunk
    foot, centre_of_mass = places
    x, y, stance, centre = walk
    for n, column in enumerate(shown):
        for i, row in enumerate(rows):
            if column >= valid[row]:
                continue
            q = qpos[row, column]
            along, _, _, across, _, _, _, _, _ = matrix(q[3], q[4], q[5], q[6])
            length = np.hypot(along, across)
            cosine, sine = along / length, across / length
            for axis in range(3):
                centre[n, i, axis] = sensors[row, column, centre_of_mass + axis]
            for leg in range(6):
                forward = sensors[row, column, foot + 3 * leg] - centre[n, i, 0]
                left = sensors[row, column, foot + 3 * leg + 1] - centre[n, i, 1]
                x[n, i, leg] = cosine * forward + sine * left
                y[n, i, leg] = cosine * left - sine * forward
                stance[n, i, leg] = standing[row, column, leg]
