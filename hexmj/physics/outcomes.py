"""Outcomes of physical walks, added up chunk by chunk: simulated walks, losses of stability, falls and effort."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from hexmj.bodies.kinematics import hinge_chains
from hexmj.conditions import Conditions
from hexmj.errors import OutOfReach, SimulationError
from hexmj.jitted import jitted
from hexmj.physics.foot_path import steps_in_chunk
from hexmj.physics.rolling import rolled
from hexmj.physics.rollout import Chunk
from hexmj.physics.settle import Settled
from hexmj.rotations import lowest, matrix
from hexmj.stability import loss_time, walk_margin
from hexmj.tipping import LossesSoFar, Pendulum
from hexmj.walks import PlannedWalk, Walk

GROUNDED = 0.1
"""Height of a foot's lowest point, as a fraction of the standing height, below which the foot is at the ground."""

MOST_UNREACHABLE = 0.1
"""Maximum share of a walk's foot targets that may be out of reach."""


@dataclass(frozen=True, eq=False, repr=False)
class Outcomes:
    """Outcomes of each start. Times are in time units, inf for events that did not happen. Measures end at the fall."""

    planned_loss: np.ndarray
    """(start,) first loss of static stability of the plan: planned stance, centre of mass at O [time units]."""
    dynamic_loss: np.ndarray
    """(start,) loss of dynamic stability of the plan, see `tipping` [time units]; NaN if it is not computed."""
    grounded_loss: np.ndarray
    """(start,) first loss of static stability: feet at the ground, the body's own centre of mass [time units]."""
    carried_loss: np.ndarray
    """(start,) first loss of static stability: feet that carry load, the body's own centre of mass [time units]."""
    fall: np.ndarray
    """(start,) first contact of the trunk with the ground [time units]."""
    fall_part: np.ndarray
    """(start,) index in `Body.trunk` of the part that touches the ground first; -1 without a fall."""
    clearance: np.ndarray
    """(start,) least height of the trunk's lowest point above z = 0 [mm]; negative if the trunk sinks in on contact."""
    tilt: np.ndarray
    """(start,) greatest angle between the trunk's vertical axis and the world's [rad]."""
    speed: np.ndarray
    """(start,) distance walked in the initial heading, divided by the commanded distance; NaN at V = 0."""
    slip: np.ndarray
    """(start,) mean sliding speed of a foot's lowest point in contact, without the foot's rolling [mm/s]."""
    tracking: np.ndarray
    """(start,) 95th percentile of the distance between a foot and its target, for targets on the ground [mm]. It is a
    multiple of `Lengths.tracking_bin`; for the stick insect of 0.01 mm, with inf for more than 20 mm."""
    depth: np.ndarray
    """(start,) greatest depth of a foot in the ground [mm]."""
    saturation: np.ndarray
    """(start,) fraction of all joints and physics steps in which the torque is at its limit."""
    unreachable: np.ndarray
    """(start,) number of foot targets out of reach; the leg then keeps its last joint angles."""

    def __repr__(self) -> str:
        times = {"planned loss": self.planned_loss, "grounded loss": self.grounded_loss}
        times |= {"carried loss": self.carried_loss, "fell": self.fall}
        counts = ", ".join(f"{name} {np.isfinite(time).sum()}" for name, time in times.items())
        least = f"; least clearance {self.clearance.min():.3g} mm" if len(self.fall) else ""
        return f"Outcomes(of {len(self.fall)}: {counts}{least})"


class _Sums(NamedTuple):
    """Sums and extremes over the substeps of each start so far."""

    clearance: np.ndarray
    """(start,) see `Outcomes.clearance`."""
    upright: np.ndarray
    """(start,) least upward component of the trunk's vertical axis, a unit vector."""
    slid: np.ndarray
    """(start,) distance that the lowest points of all feet slid in contact [mm]."""
    contacts: np.ndarray
    """(start,) number of substeps in contact, summed over the feet."""
    saturated: np.ndarray
    """(start,) number of substeps at the torque limit, summed over the joints."""
    shown: np.ndarray
    """(start,) number of substeps so far."""
    misses: np.ndarray
    """(start, bin) histogram of the distances of feet from their targets."""


class OutcomesSoFar:
    """Adds up the outcomes of all starts, chunk by chunk."""

    def __init__(self, settled: Settled, planned_loss: np.ndarray, dynamic_loss: np.ndarray | None = None) -> None:
        """Begin with the times of the plan's losses of static and dynamic stability, (start,) [time units]."""
        size, compiled, lengths = len(settled.starts), settled.compiled, settled.conditions.body.lengths
        self._settled, self._planned_loss = settled, planned_loss
        self._dynamic_loss = np.full(size, np.nan) if dynamic_loss is None else dynamic_loss
        self._grounded_loss, self._carried_loss, self._fall = np.full((3, size), np.inf)
        self._fall_part, self._unreachable = np.full(size, -1), np.zeros(size, dtype=int)
        self._walked, self._commanded, self._depth = np.zeros((3, size))
        upright, (slid, contacts, saturated, shown) = np.ones(size), np.zeros((4, size))
        misses = np.zeros((size, lengths.tracking_bins + 1), dtype=np.uint32)
        self._sums = _Sums(np.full(size, np.inf), upright, slid, contacts, saturated, shown, misses)
        self._before = np.zeros((size, compiled.model.nq)), np.zeros((size, compiled.model.nsensordata))
        columns, ground = compiled.columns, -settled.conditions.standing_height
        self._body = columns.foot.start, columns.touch.start, *compiled.trunk_corners, 0.999 * compiled.torque_limits
        self._scale, chains = (ground, lengths.tracking_bin), hinge_chains(compiled.model, compiled.body)
        self._rolling = chains.axis, chains.zero, compiled.foot_radius

    def add(self, chunk: Chunk) -> None:
        """Add one chunk of `rollout.drive`."""
        settled, ids, dt, m = self._settled, chunk.ids, self._settled.stride.dt, self._settled.substeps
        seen = chunk.qpos, chunk.sensors, np.ascontiguousarray(chunk.targets), chunk.force, chunk.valid
        since = self._before, chunk.first, len(chunk.plan.time) * m, steps_in_chunk(m) * m
        _scan(seen, since, ids, self._body, self._rolling, self._scale, self._sums)
        n, last = np.arange(len(ids)), chunk.valid - 1
        for before, now in zip(self._before, (chunk.qpos, chunk.sensors), strict=True):
            before[ids] = now[n, last]
        trunk = chunk.sensors[n, last, settled.compiled.columns.trunk] > 0
        fell, until = chunk.fell, np.where(chunk.fell, last, chunk.valid)
        self._fall[ids[fell]] = ((chunk.first + last) / m * dt)[fell]
        self._fall_part[ids[fell]] = np.argmax(trunk, axis=1)[fell]
        self._unreachable[ids] += chunk.unreachable
        self._walked[ids] = chunk.qpos[n, last, 0] - settled.state[ids, 0]
        depth = np.where(np.arange(chunk.depth.shape[1]) < until[:, None], chunk.depth, 0.0)
        self._depth[ids] = np.maximum(self._depth[ids], depth.max(axis=1))
        share = np.clip(until - m * np.arange(len(chunk.plan.time))[:, None], 0, m) / m
        steps = np.vstack([self._commanded[ids], share * chunk.plan.velocity[:, ids]])
        self._commanded[ids] = np.add.accumulate(steps)[-1]  # step by step, so that chunks do not change the bits
        stable = np.flatnonzero(np.isinf(self._carried_loss[ids]) | np.isinf(self._grounded_loss[ids]))
        ends = measured_walk(chunk, settled, stable)
        if ends.measured.stance.size:
            near, which = grounded(ends.measured, ends.height, settled.conditions), ids[stable]
            for loss, walk in ((self._carried_loss, ends.measured), (self._grounded_loss, near)):
                loss[which] = np.minimum(loss[which], loss_time(walk, threads=1))

    def outcomes(self) -> Outcomes:
        """Return the outcomes of each start in the chunks so far.

        Raises:
            OutOfReach: the share of a walk's targets that are out of reach exceeds `MOST_UNREACHABLE`.
            SimulationError: a measure of a walk is NaN, for example the slip if no foot is ever in contact.
        """
        sums, compiled, lengths = self._sums, self._settled.compiled, self._settled.conditions.body.lengths
        with np.errstate(invalid="ignore", divide="ignore"):
            speed = np.where(self._commanded > 0, self._walked / (self._commanded * self._settled.stride.dt), np.nan)
            slip = sums.slid / (sums.contacts * compiled.model.opt.timestep)
            saturation = sums.saturated / (sums.shown * len(compiled.torque_limits))
        found = Outcomes(
            planned_loss=self._planned_loss,
            dynamic_loss=self._dynamic_loss,
            grounded_loss=self._grounded_loss,
            carried_loss=self._carried_loss,
            fall=self._fall,
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
        missed = self._unreachable / (6.0 * sums.shown)
        if (missed > MOST_UNREACHABLE).any():
            start = int(np.argmax(missed > MOST_UNREACHABLE))
            limit = f"(limit: {MOST_UNREACHABLE:.0%})"
            raise OutOfReach(f"Start {start}: {missed[start]:.0%} of the foot targets are out of reach {limit}.")
        for name in ("clearance", "tilt", "slip", "depth", "saturation"):  # speed is NaN at V = 0
            if (wrong := np.isnan(getattr(found, name))).any():
                raise SimulationError(f"start {int(np.argmax(wrong))}: its {name} is NaN")
        return found


class WalkSoFar(OutcomesSoFar):
    """Stores the walks of all starts, chunk by chunk, for `PhysicalWalk`, and adds up their outcomes."""

    def __init__(self, settled: Settled, planned: PlannedWalk, threads: int | None = None) -> None:
        """Begin with the plan of the whole walk; a body with sensors of the feet's forces also stores forces."""
        pendulum = Pendulum.of(settled.conditions.standing_height, settled.conditions.seconds(settled.stride))
        so_far = LossesSoFar(pendulum, len(settled.starts))
        so_far.add(walk_margin(planned, threads), np.full(len(settled.starts), len(planned.time)))
        static, dynamic, _ = so_far.losses
        super().__init__(settled, *(np.where(step > 0, step * settled.stride.dt, np.inf) for step in (static, dynamic)))
        shape, compiled = planned.stance.shape, settled.compiled
        axes = {"height": (6,), "load": (6,), "qpos": (compiled.model.nq,), "centre_of_mass": (3,)}
        if compiled.columns.feet_push.stop > compiled.columns.feet_push.start:
            axes |= {"torque": (compiled.joints,), "ground_force": (6, 3)}
        self.kept: dict[str, Any] = {name: np.full((*shape[:2], *own), np.nan) for name, own in axes.items()}
        (x, y), stance = np.full((2, *shape), np.nan), np.zeros(shape, dtype=bool)
        self.measured = Walk(planned.time, planned.velocity, x, y, stance, planned.geometry)

    def add(self, chunk: Chunk) -> None:
        """Add one chunk of `rollout.drive`."""
        super().add(chunk)
        substeps, measured, centre, height = measured_walk(chunk, self._settled)
        columns, sensors = self._settled.compiled.columns, chunk.sensors[:, substeps]
        at = np.ix_((chunk.first + substeps) // self._settled.substeps - 1, chunk.ids)
        for name in ("x", "y", "stance"):
            getattr(self.measured, name)[at] = getattr(measured, name)
        found = {name: getattr(chunk, name)[:, substeps] for name in ("load", "qpos", "torque") if name in self.kept}
        if "ground_force" in self.kept:
            found["ground_force"] = 0.0 - sensors[..., columns.feet_push].reshape(*sensors.shape[:2], 6, 3)
            found["ground_force"][..., 2] -= sensors[..., columns.touch] - found["load"]  # adhesion
        for name, values in found.items():
            values.swapaxes(0, 1)[substeps[:, None] >= chunk.valid] = np.nan
            self.kept[name][at] = values.swapaxes(0, 1)
        self.kept["height"][at], self.kept["centre_of_mass"][at] = height, centre


def _percentile(counts: np.ndarray, share: float, width: float) -> np.ndarray:
    """Return the end [mm] of the bin in which a share of the counts, (start, bin), is reached; inf for the last bin."""
    reached = np.cumsum(counts, axis=1) >= share * counts.sum(axis=1, keepdims=True)
    ends = np.append(np.arange(1, counts.shape[1]) * width, np.inf)
    return np.where(counts.any(axis=1), ends[np.argmax(reached, axis=1)], np.nan)


class StepEnds(NamedTuple):
    """The bodies of n starts at the ends of the plan's steps within a chunk."""

    substeps: np.ndarray
    """(step,) substeps of the chunk at which these steps end."""
    measured: Walk
    """Walk of the feet that carry load; after a fall it is NaN and no foot stands. Its velocities are all NaN."""
    centre_of_mass: np.ndarray
    """(step, n, 3) centre of mass in the world [mm]; NaN after a fall."""
    height: np.ndarray
    """(step, n, leg) height of the feet's lowest points above the ground [mm]; NaN after a fall."""


def grounded(measured: Walk, height: np.ndarray, conditions: Conditions) -> Walk:
    """Return a simulated walk in which all feet at the ground stand: those below `GROUNDED` standing heights.

    Args:
        measured: walk of the simulated bodies.
        height: height of the feet's lowest points above the ground, (step, start, leg) [mm].
        conditions: conditions of the walk.
    """
    return replace(measured, stance=height < GROUNDED * conditions.standing_height)


def measured_walk(chunk: Chunk, settled: Settled, rows: np.ndarray | None = None) -> StepEnds:
    """Return the bodies at the ends of the plan's steps within a chunk.

    Args:
        chunk: a chunk of `rollout.drive`.
        settled: all starts of the walk.
        rows: rows of the chunk whose starts are measured, (n,), by default all.
    """
    m, stride, columns = settled.substeps, settled.stride, settled.compiled.columns
    rows = np.arange(len(chunk.ids)) if rows is None else rows
    substep = np.arange(chunk.qpos.shape[1])
    shown = substep[((chunk.first + substep) % m == 0) & (chunk.first + substep > 0)]
    shape, (ahead, left, down) = (len(shown), len(rows)), settled.conditions.down
    lean = -ahead / down, -left / down
    x, y, stance = np.full((*shape, 6), np.nan), np.full((*shape, 6), np.nan), np.zeros((*shape, 6), dtype=bool)
    centre, places = np.full((*shape, 3), np.nan), (columns.foot.start, columns.centre_of_mass.start)
    _measure(
        (chunk.qpos, chunk.sensors, chunk.standing, chunk.valid), rows, shown, places, lean, (x, y, stance, centre)
    )
    time, velocity = (chunk.first + shown) // m * stride.dt, np.full(shape, np.nan)
    walk = Walk(time, velocity, x - np.array(stride.geometry.origin), y, stance, stride.geometry)
    feet = chunk.sensors[rows, shown[:, None], columns.foot].reshape(*shape, 6, 3)
    known = (shown[:, None] < chunk.valid[rows])[..., None]
    return StepEnds(shown, walk, centre, np.where(known, -settled.compiled.depth(feet), np.nan))


class EffortSoFar:
    """Positive work of the joints and their greatest torque until the fall of each start, updated chunk by chunk.

    Work is the sum over joints and physics steps of max(torque x speed, 0) h, with `Chunk.torque` and the step h. A
    joint that moves against its torque does no work and recovers none.
    """

    work: np.ndarray
    """(start,) positive work of all joints [g mm^2/s^2]."""
    torque: np.ndarray
    """(start,) greatest torque of a joint, as a fraction of the torque limit."""

    def __init__(self, settled: Settled) -> None:
        """Begin with zero work and torque."""
        size, compiled = len(settled.starts), settled.compiled
        self.work, self.torque = np.zeros(size), np.zeros(size)
        self._columns, self._limits = compiled.columns, compiled.torque_limits
        self._rows = np.zeros((size, 0, 2, compiled.joints))  # last angles and torques of the previous chunk

    def add(self, chunk: Chunk) -> None:
        """Add one chunk; the work of its last substep is added with the next chunk, which has the angles after it."""
        before = self._rows[chunk.ids]
        now = np.stack([chunk.qpos[..., self._columns.qpos], chunk.torque], axis=2)
        rows = np.concatenate([before, now], axis=1)
        turned, torques = np.diff(rows[:, :, 0], axis=1), rows[:, :-1, 1]
        walking = np.arange(rows.shape[1] - 1) - before.shape[1] + 1 < chunk.valid[:, None]
        self.work[chunk.ids] += (np.maximum(torques * turned, 0.0).sum(axis=2) * walking).sum(axis=1)
        share = (np.abs(torques) / self._limits).max(axis=2) * walking
        self.torque[chunk.ids] = np.maximum(self.torque[chunk.ids], share.max(axis=1, initial=0.0))
        self._rows = np.zeros((len(self.work), 1, *now.shape[2:]))
        self._rows[chunk.ids] = rows[:, -1:]


@jitted
def _scan(chunk: Any, since: Any, ids: Any, body: Any, rolling: Any, scale: Any, sums: Any) -> None:
    """Add a chunk's substeps to the sums of its starts.

    Sliding to a substep at which a chunk of default length would begin does not count, even if pushes shorten chunks.
    """
    qpos, sensors, targets, force, valid = chunk
    (last_qpos, last_sensors), first, end, default_length = since
    feet, touch, corner, radius, limit = body
    for i, start in enumerate(ids):
        for t in range(valid[i]):
            slides = t == end or (first + t) % default_length != 0
            q, sensed = qpos[i, t], sensors[i, t]
            q_before, before = (qpos[i, t - 1], sensors[i, t - 1]) if t > 0 else (last_qpos[start], last_sensors[start])
            _count_misses(q, sensed[feet : feet + 18], targets[i, t], scale, sums.misses[start])
            _, _, _, _, _, _, _, _, up_z = matrix(q[3], q[4], q[5], q[6])
            sums.clearance[start] = min(sums.clearance[start], lowest(q, corner, radius))
            sums.upright[start] = min(sums.upright[start], up_z)
            for leg in range(6):
                if slides and sensed[touch + leg] > 0 and before[touch + leg] > 0:
                    f = feet + 3 * leg
                    ahead, left = rolled(q_before, q, leg, rolling)
                    sums.slid[start] += np.hypot(sensed[f] - before[f] - ahead, sensed[f + 1] - before[f + 1] - left)
                    sums.contacts[start] += 1.0
            for joint in range(len(limit)):
                sums.saturated[start] += abs(force[i, t, joint]) >= limit[joint]
            sums.shown[start] += 1.0


@jitted
def _count_misses(qpos: Any, feet: Any, targets: Any, scale: Any, counts: Any) -> None:
    """Count the distance of each foot, (leg * axis), from its target, (leg, 3), if the target is on the ground."""
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


@jitted
def _measure(chunk: Any, rows: Any, shown: Any, places: Any, lean: Any, walk: Any) -> None:
    """Write the feet until the fall to `walk`: relative to the centre of mass, along the root's heading.

    The centre of mass is projected along gravity to z = 0, by `lean` times its height.
    """
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
            below_x = centre[n, i, 0] + lean[0] * centre[n, i, 2]
            below_y = centre[n, i, 1] + lean[1] * centre[n, i, 2]
            for leg in range(6):
                forward = sensors[row, column, foot + 3 * leg] - below_x
                left = sensors[row, column, foot + 3 * leg + 1] - below_y
                x[n, i, leg] = cosine * forward + sine * left
                y[n, i, leg] = cosine * left - sine * forward
                stance[n, i, leg] = standing[row, column, leg]
