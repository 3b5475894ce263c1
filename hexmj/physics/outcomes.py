"""What a physical walk has shown: the measured walk, and how every start went."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hexmj.errors import OutOfReach
from hexmj.jitted import jitted
from hexmj.physics.backend import Diverged
from hexmj.physics.divergence import walk_error
from hexmj.physics.drive import Chunk
from hexmj.physics.measured import measured_walk
from hexmj.physics.orders import steps_in_chunk
from hexmj.physics.settling import Settled
from hexmj.rotations import lowest, matrix
from hexmj.stability import loss_time

NUMBERS = ("clearance", "tilt", "slip", "depth", "saturation")
"""Outcomes that every walk has; speed is NaN at V = 0, tracking where no tip shall be on the ground."""

HAPPENED = {"lost on paper": "planned_loss", "lost as measured": "measured_loss", "fell": "fall", "toppled": "topple"}
"""What can happen to a start -> the time at which it did."""

TOPPLED = 0.1
"""Tilt of the trunk beyond which it has toppled, whatever the direction [rad]; see `docs/falls.md`."""

MOST_UNREACHABLE = 0.1
"""Share of the tips that may be out of reach in a walk that counts."""

LEAST_UPRIGHT = float(np.cos(TOPPLED))
"""Upward component of the trunk's vertical at that tilt."""


@dataclass(frozen=True, eq=False, repr=False)
class Outcomes:
    """How every start went; times in time units, inf where it did not happen."""

    planned_loss: np.ndarray
    """(start,) first loss of static stability of the plan: planned polygon, centre of mass at O."""
    measured_loss: np.ndarray
    """(start,) first loss of measured static stability: feet in contact, the body's centre of mass."""
    fall: np.ndarray
    """(start,) first contact of head, thorax or abdomen with the ground."""
    topple: np.ndarray
    """(start,) first tilt of the trunk by more than `TOPPLED`; until the fall, as everything here."""
    fall_part: np.ndarray
    """(start,) index in `Body.trunk` of the part that touched first, -1 for none."""
    clearance: np.ndarray
    """(start,) least height of the trunk's lowest point above z = 0 [mm], whatever lies ahead; below it by how far it
    sinks in on contact."""
    tilt: np.ndarray
    """(start,) greatest angle between the trunk's vertical and the world's [rad]."""
    speed: np.ndarray
    """(start,) distance walked ahead, as it stood at first, over distance commanded, until the fall; NaN at V = 0."""
    slip: np.ndarray
    """(start,) mean sliding speed of a foot in contact [mm/s]."""
    tracking: np.ndarray
    """(start,) 95th percentile of the distance between a foot and its target while that is on the ground [mm], in bins
    of `Lengths.tracking_bin`: to 0.01 mm, and inf beyond 20 mm, of the stick insect."""
    depth: np.ndarray
    """(start,) how deep the deepest foot was in the ground until the fall [mm]."""
    saturation: np.ndarray
    """(start,) fraction of joints times physics steps in which the torque stood at its limit."""
    unreachable: np.ndarray
    """(start,) tip targets out of reach; such a leg keeps its last angles and is counted here."""

    def __repr__(self) -> str:
        counts = ", ".join(f"{name} {int(np.isfinite(getattr(self, time)).sum())}" for name, time in HAPPENED.items())
        least = f"; least clearance {self.clearance.min():.3g} mm" if len(self.fall) else ""
        return f"Outcomes(of {len(self.fall)}: {counts}{least})"


class _Sums(NamedTuple):
    """What is added up of every start, or the least of it so far."""

    clearance: np.ndarray
    """(start,) see `Outcomes.clearance`."""
    upright: np.ndarray
    """(start,) least upward component of the trunk's vertical."""
    toppled: np.ndarray
    """(start,) substeps until the trunk has toppled; inf where it has not."""
    slid: np.ndarray
    """(start,) way that feet slid in contact [mm]."""
    contacts: np.ndarray
    """(start,) substeps in which a foot was in contact, over all feet."""
    saturated: np.ndarray
    """(start,) substeps in which a torque stood at its limit, over all joints."""
    shown: np.ndarray
    """(start,) substeps."""
    misses: np.ndarray
    """(start, bin) how often a foot was so far from its target on the ground."""


class OutcomesSoFar:
    """Adds up the outcomes of all starts, chunk by chunk."""

    def __init__(self, settled: Settled, planned_loss: np.ndarray) -> None:
        """Begin with nothing but the plan's losses, (start,) [time units]."""
        size, compiled, lengths = len(settled.starts), settled.compiled, settled.conditions.body.lengths
        self._settled, self._planned_loss = settled, planned_loss
        self._measured_loss, self._fall = np.full(size, np.inf), np.full(size, np.inf)
        self._fall_part, self._unreachable = np.full(size, -1), np.zeros(size, dtype=int)
        self._walked, self._commanded, self._depth = np.zeros((3, size))
        misses = np.zeros((size, lengths.tracking_bins + 1), dtype=np.uint32)
        slid, contacts, saturated, shown = np.zeros((4, size))
        never = np.full(size, np.inf)
        self._sums = _Sums(never, np.ones(size), never.copy(), slid, contacts, saturated, shown, misses)
        self._before = np.zeros((size, compiled.model.nsensordata))
        columns, ground = compiled.columns, -settled.conditions.standing_height
        self._body = columns.foot.start, columns.touch.start, *compiled.trunk_corners, 0.999 * compiled.torque_limits
        self._scale = ground, lengths.tracking_bin

    def add(self, chunk: Chunk) -> None:
        """Take in one chunk of `drive.drive`."""
        settled, ids, dt, m = self._settled, chunk.ids, self._settled.stride.dt, self._settled.substeps
        seen = chunk.qpos, chunk.sensors, np.ascontiguousarray(chunk.targets), chunk.force, chunk.valid
        since = self._before, chunk.first, len(chunk.plan.time) * m, steps_in_chunk(m) * m
        _scan(seen, since, ids, self._body, self._scale, self._sums)
        n, last = np.arange(len(ids)), chunk.valid - 1
        self._before[ids] = chunk.sensors[n, last]
        trunk = chunk.sensors[n, last, settled.compiled.columns.trunk] > 0
        fell, until = chunk.fell, np.where(chunk.fell, last, chunk.valid)
        self._fall[ids[fell]] = ((chunk.first + last) / m * dt)[fell]
        self._fall_part[ids[fell]] = np.argmax(trunk, axis=1)[fell]
        self._unreachable[ids] += chunk.unreachable
        self._walked[ids] = chunk.qpos[n, last, 0] - settled.qpos[ids, 0]
        depth = np.where(np.arange(chunk.depth.shape[1]) < until[:, None], chunk.depth, 0.0)
        self._depth[ids] = np.maximum(self._depth[ids], depth.max(axis=1))
        share = np.clip(until - m * np.arange(len(chunk.plan.time))[:, None], 0, m) / m
        steps = np.vstack([self._commanded[ids], share * chunk.plan.velocity[:, ids]])
        self._commanded[ids] = np.add.accumulate(steps)[-1]  # step by step: the same bits, however chunks are cut
        stable = np.flatnonzero(np.isinf(self._measured_loss[ids]))
        _, measured, _ = measured_walk(chunk, settled, stable)
        if measured.stance.size:
            self._measured_loss[ids[stable]] = loss_time(measured, threads=1)

    def outcomes(self) -> Outcomes:
        """How every start went, as far as the chunks reach.

        Raises:
            OutOfReach: a walk of which more than `MOST_UNREACHABLE` of the tips could not be reached.
            SimulationError: a walk of which something cannot be measured, as the slip where no foot is ever in contact.
        """
        sums, compiled, lengths = self._sums, self._settled.compiled, self._settled.conditions.body.lengths
        with np.errstate(invalid="ignore", divide="ignore"):
            speed = np.where(self._commanded > 0, self._walked / (self._commanded * self._settled.stride.dt), np.nan)
            slip = sums.slid / (sums.contacts * compiled.model.opt.timestep)
            saturation = sums.saturated / (sums.shown * compiled.joints)
        found = Outcomes(
            planned_loss=self._planned_loss,
            measured_loss=self._measured_loss,
            fall=self._fall,
            topple=sums.toppled / self._settled.substeps * self._settled.stride.dt,
            fall_part=self._fall_part,
            clearance=sums.clearance,
            tilt=np.arccos(np.clip(sums.upright, -1.0, 1.0)),
            speed=speed,
            slip=slip,
            tracking=_percentile(sums.misses, 0.95, lengths.tracking_bin),
            depth=self._depth,
            saturation=saturation,
            unreachable=self._unreachable,
        )
        asked = 6.0 * sums.shown
        if (lost := self._unreachable > MOST_UNREACHABLE * asked).any():
            start = int(np.argmax(lost))
            raise OutOfReach(
                f"start {start}: {self._unreachable[start]} of {asked[start]:.0f} tips that its legs were told are out"
                " of reach; expected at most a tenth, or nothing is walked"
            )
        for name in NUMBERS:
            if (wrong := np.isnan(getattr(found, name))).any():
                start = int(np.argmax(wrong))
                kinds = f"its {name} is no number" + (", since no foot has stood" if name == "slip" else "")
                error = Diverged(start, kinds, self._settled.saved(start))
                raise walk_error(error, "walking", 0.0, self._settled.conditions)
        return found


def _percentile(counts: np.ndarray, share: float, width: float) -> np.ndarray:
    """Upper end [mm] of the bin that holds this share of the counts, (start, bin); inf in the last, open one."""
    reached = np.cumsum(counts, axis=1) >= share * counts.sum(axis=1, keepdims=True)
    ends = np.append(np.arange(1, counts.shape[1]) * width, np.inf)
    return np.where(counts.any(axis=1), ends[np.argmax(reached, axis=1)], np.nan)


@jitted
def _scan(chunk: Any, since: Any, ids: Any, body: Any, scale: Any, sums: Any) -> None:
    """Take a chunk's substeps into the sums and counts of its starts; of sliding those to the first substep of a usual
    chunk, wherever pushes cut it, are left out."""
    qpos, sensors, targets, force, valid = chunk
    last, first, end, usual = since
    feet, touch, corner, radius, limit = body
    for i, start in enumerate(ids):
        for t in range(valid[i]):
            slides = t == end or (first + t) % usual != 0
            q, sensed, before = qpos[i, t], sensors[i, t], sensors[i, t - 1] if t > 0 else last[start]
            _count_misses(q, sensed[feet : feet + 18], targets[i, t], scale, sums.misses[start])
            _, _, _, _, _, _, _, _, up_z = matrix(q[3], q[4], q[5], q[6])
            sums.clearance[start] = min(sums.clearance[start], lowest(q, corner, radius))
            sums.upright[start] = min(sums.upright[start], up_z)
            if up_z < LEAST_UPRIGHT:
                sums.toppled[start] = min(sums.toppled[start], sums.shown[start])
            for leg in range(6):
                if slides and sensed[touch + leg] > 0 and before[touch + leg] > 0:
                    f = feet + 3 * leg
                    sums.slid[start] += np.hypot(sensed[f] - before[f], sensed[f + 1] - before[f + 1])
                    sums.contacts[start] += 1.0
            for joint in range(len(limit)):
                sums.saturated[start] += abs(force[i, t, joint]) >= limit[joint]
            sums.shown[start] += 1.0


@jitted
def _count_misses(qpos: Any, feet: Any, targets: Any, scale: Any, counts: Any) -> None:
    """Count the distance of each foot, (leg * axis), from its target, (leg, 3), if that is on the ground."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = matrix(qpos[3], qpos[4], qpos[5], qpos[6])
    ground, width = scale
    for leg in range(6):
        a, b, c = targets[leg]
        if c == ground:
            off_x = qpos[0] + xx * a + xy * b + xz * c - feet[3 * leg]
            off_y = qpos[1] + yx * a + yy * b + yz * c - feet[3 * leg + 1]
            off_z = qpos[2] + zx * a + zy * b + zz * c - feet[3 * leg + 2]
            place, last = np.sqrt(off_x * off_x + off_y * off_y + off_z * off_z) / width, len(counts) - 1
            counts[int(place) if place < last else last] += 1
