"""What a physical walk has shown: the measured walk, and how every start went."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from hexmj.physics.drive import Chunk
from hexmj.physics.settling import Settled
from hexmj.rotations import matrix
from hexmj.stability import loss_time
from hexmj.walks import Walk


@dataclass(frozen=True, eq=False)
class Outcomes:
    """How every start went; times in time units, inf where it did not happen."""

    planned_loss: np.ndarray
    """(start,) first loss of static stability of the plan: planned polygon, centre of mass at O."""
    measured_loss: np.ndarray
    """(start,) first loss of measured static stability: feet in contact, the body's centre of mass."""
    fall: np.ndarray
    """(start,) first contact of head, thorax or abdomen with the ground."""
    fall_part: np.ndarray
    """(start,) index in `Body.trunk` of the part that touched first, -1 for none."""
    clearance: np.ndarray
    """(start,) least height of the trunk's lowest point [mm]; below 0 by how far it sinks in on contact."""
    tilt: np.ndarray
    """(start,) greatest angle between the trunk's vertical and the world's [rad]."""
    speed: np.ndarray
    """(start,) distance walked ahead over distance commanded, until the fall; NaN at V = 0."""
    slip: np.ndarray
    """(start,) mean sliding speed of a foot in contact [mm/s]."""
    tracking: np.ndarray
    """(start,) 95th percentile of the distance between a foot and its target while that is on the ground [mm], to
    0.01 mm; inf beyond 20 mm."""
    depth: np.ndarray
    """(start,) how deep the deepest foot was in the ground until the fall [mm]."""
    saturation: np.ndarray
    """(start,) fraction of joints times physics steps in which the torque stood at its limit."""
    unreachable: np.ndarray
    """(start,) tip targets out of reach; such a leg keeps its last angles and is counted here."""


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
        world, (step, n, 3) [mm].  The walk is NaN, and no foot stands, after a fall.
    """
    m, stride = settled.conditions.substeps(settled.stride), settled.stride
    rows = np.arange(len(chunk.ids)) if rows is None else rows
    substep = np.arange(chunk.qpos.shape[1])
    shown = substep[((chunk.first + substep) % m == 0) & (chunk.first + substep > 0)]
    columns = settled.compiled.columns
    shape = len(shown), len(rows)
    x, y = np.full((*shape, 6), np.nan), np.full((*shape, 6), np.nan)
    stance, centre = np.zeros((*shape, 6), dtype=bool), np.full((*shape, 3), np.nan)
    seen = chunk.qpos, chunk.sensors, chunk.standing, chunk.valid
    _look(*seen, rows, shown, columns.foot.start, columns.centre_of_mass.start, x, y, stance, centre)
    step = (chunk.first + shown) // m
    walk = Walk(
        time=step * stride.dt,
        velocity=chunk.plan.velocity[np.maximum(step - 1 - chunk.first // m, 0)][:, chunk.ids[rows]],
        x=x - np.array(stride.geometry.origin),
        y=y,
        stance=stance,
        geometry=stride.geometry,
    )
    return shown, walk, centre


@njit(cache=True, nogil=True)
def _look(
    qpos: Any, sensors: Any, standing: Any, valid: Any, rows: Any, shown: Any, foot: int, centre_of_mass: int,
    x: Any, y: Any, stance: Any, centre: Any,
) -> None:  # fmt: skip
    """Feet ahead of and beside the centre of mass, seen along the root's heading, up to the fall."""
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


class RunningOutcomes:
    """Adds up the outcomes of all starts, chunk by chunk."""

    def __init__(self, settled: Settled, planned_loss: np.ndarray) -> None:
        """Begin with nothing but the plan's losses, (start,) [time units]."""
        size = len(settled.starts)
        self._settled = settled
        self._planned_loss = planned_loss
        self._measured_loss, self._fall = np.full(size, np.inf), np.full(size, np.inf)
        self._fall_part, self._unreachable = np.full(size, -1), np.zeros(size, dtype=int)
        self._walked, self._commanded = np.zeros(size), np.zeros(size)
        self._sums = np.zeros((size, len(_SUMS)))
        self._sums[:, _CLEARANCE], self._sums[:, _UPRIGHT] = np.inf, 1.0
        lengths = settled.conditions.body.lengths
        self._bins = lengths.tracking_bin, lengths.tracking_bins
        self._misses = np.zeros((size, lengths.tracking_bins + 1), dtype=np.uint32)
        self._depth, self._corners = np.zeros(size), settled.compiled.trunk_corners

    def add(self, chunk: Chunk) -> None:
        """Take in one chunk of `drive.drive`."""
        settled, ids = self._settled, chunk.ids
        compiled, dt, m = settled.compiled, settled.stride.dt, settled.conditions.substeps(settled.stride)
        columns, limit = compiled.columns, compiled.torque_limits
        feet, touch = columns.foot.start, columns.touch.start
        seen = chunk.qpos, chunk.sensors, chunk.targets, chunk.force, chunk.valid
        ground = -settled.conditions.path.standing_height
        _scan(*seen, feet, touch, ground, *self._corners, 0.999 * limit, self._bins[0], self._sums, self._misses, ids)
        n, last = np.arange(len(ids)), chunk.valid - 1
        trunk = chunk.sensors[n, last, columns.trunk] > 0
        fell, until = chunk.fell, np.where(chunk.fell, last, chunk.valid)
        self._fall[ids[fell]] = ((chunk.first + last) / m * dt)[fell]
        self._fall_part[ids[fell]] = np.argmax(trunk, axis=1)[fell]
        self._unreachable[ids] += chunk.unreachable
        self._walked[ids] = chunk.qpos[n, last, 0] - settled.qpos[ids, 0]
        depth = np.where(np.arange(chunk.depth.shape[1]) < until[:, None], chunk.depth, 0.0)
        self._depth[ids] = np.maximum(self._depth[ids], depth.max(axis=1))
        share = np.clip(until / m - np.arange(len(chunk.plan.time))[:, None], 0.0, 1.0)
        self._commanded[ids] += np.cumsum(share * chunk.plan.velocity[:, ids], axis=0)[-1] * dt
        stable = np.flatnonzero(np.isinf(self._measured_loss[ids]))
        _, measured, _ = measured_walk(chunk, settled, stable)
        if measured.stance.size:
            self._measured_loss[ids[stable]] = loss_time(measured, threads=1)

    def outcomes(self) -> Outcomes:
        """How every start went, as far as the chunks reach."""
        sums, timestep = self._sums, self._settled.compiled.model.opt.timestep
        with np.errstate(invalid="ignore", divide="ignore"):
            speed = np.where(self._commanded > 0, self._walked / self._commanded, np.nan)
            slip = sums[:, _SLID] / (sums[:, _CONTACTS] * timestep)
        return Outcomes(
            planned_loss=self._planned_loss,
            measured_loss=self._measured_loss,
            fall=self._fall,
            fall_part=self._fall_part,
            clearance=sums[:, _CLEARANCE],
            tilt=np.arccos(np.clip(sums[:, _UPRIGHT], -1.0, 1.0)),
            speed=speed,
            slip=slip,
            tracking=_percentile(self._misses, 0.95, *self._bins),
            depth=self._depth,
            saturation=sums[:, _SATURATED] / (sums[:, _SHOWN] * self._settled.compiled.joints),
            unreachable=self._unreachable,
        )


def _percentile(counts: np.ndarray, share: float, width: float, bins: int) -> np.ndarray:
    """Upper end [mm] of the bin that holds this share of the counts, (start, bin); inf in the last, open one."""
    reached = np.cumsum(counts, axis=1) >= share * counts.sum(axis=1, keepdims=True)
    ends = np.append(np.arange(1, bins + 1) * width, np.inf)
    return np.where(counts.any(axis=1), ends[np.argmax(reached, axis=1)], np.nan)


_SUMS = _CLEARANCE, _UPRIGHT, _SLID, _CONTACTS, _SATURATED, _SHOWN = range(6)


@njit(cache=True, nogil=True)
def _scan(
    qpos: Any, sensors: Any, targets: Any, force: Any, valid: Any, feet: int, touch: int, ground: float,
    corner: Any, radius: Any, limit: Any, width: float, sums: Any, misses: Any, ids: Any,
) -> None:  # fmt: skip
    """Take a chunk's substeps into the sums and counts of its starts."""
    for i, start in enumerate(ids):
        total = sums[start]
        for t in range(valid[i]):
            _count_misses(qpos[i, t], sensors[i, t, feet : feet + 18], targets[i, t], ground, width, misses[start])
            z, q = qpos[i, t, 2], qpos[i, t]
            _, _, _, _, _, _, up_x, up_y, up_z = matrix(q[3], q[4], q[5], q[6])
            for c in range(len(corner)):
                height = z + up_x * corner[c, 0] + up_y * corner[c, 1] + up_z * corner[c, 2] - radius[c]
                total[_CLEARANCE] = min(total[_CLEARANCE], height)
            total[_UPRIGHT] = min(total[_UPRIGHT], up_z)
            for leg in range(6):
                if t > 0 and sensors[i, t, touch + leg] > 0 and sensors[i, t - 1, touch + leg] > 0:
                    f = feet + 3 * leg
                    forward = sensors[i, t, f] - sensors[i, t - 1, f]
                    total[_SLID] += np.hypot(forward, sensors[i, t, f + 1] - sensors[i, t - 1, f + 1])
                    total[_CONTACTS] += 1.0
            for joint in range(len(limit)):
                total[_SATURATED] += abs(force[i, t, joint]) >= limit[joint]
            total[_SHOWN] += 1.0


@njit(cache=True, nogil=True)
def _count_misses(qpos: Any, feet: Any, targets: Any, ground: float, width: float, counts: Any) -> None:
    """Count the distance of each foot, (leg * axis), from its target, (leg, 3), if that is on the ground."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = matrix(qpos[3], qpos[4], qpos[5], qpos[6])
    for leg in range(6):
        a, b, c = targets[leg, 0], targets[leg, 1], targets[leg, 2]
        if c == ground:
            off_x = qpos[0] + xx * a + xy * b + xz * c - feet[3 * leg]
            off_y = qpos[1] + yx * a + yy * b + yz * c - feet[3 * leg + 1]
            off_z = qpos[2] + zx * a + zy * b + zz * c - feet[3 * leg + 2]
            place, last = np.sqrt(off_x * off_x + off_y * off_y + off_z * off_z) / width, len(counts) - 1
            counts[int(place) if place < last else last] += 1
