"""Quantities of gait, forces, torques, posture and work, measured in the last whole strides of physical walks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.controllers.planning import begin
from hexmj.legs import SIDE
from hexmj.measures.tables import WalkSettings
from hexmj.phases import CONTRALATERAL, IPSILATERAL, PAIRS, circular_mean
from hexmj.progress import Progress
from hexmj.rotations import heading, rotated, turned

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.rollout import Chunk
    from hexmj.physics.settle import Settled

SEGMENTS = ("front", "middle", "hind")
"""Names of the pairs of legs, from front to rear."""

JOINTS = ("thorax-coxa", "coxa-trochanter", "femur-tibia")
"""Names of the joints of a leg with three joints, from the body outwards."""

WHOLE = {
    "speed": "mm/s",
    "ripple: least over mean speed": "1",
    "period": "s",
    "duty factor": "1",
    "way of a standing foot": "mm",
    "phase, ipsilateral": "1",
    "phase, contralateral": "1",
    "vertical peaks: greatest over least": "1",
    "work of standing legs at the coxa-trochanter": "%",
    "pitch of the thorax": "deg",
    "cost of transport, positive work": "1",
    "cost of transport, all work": "1",
    "positive work of the joints": "J/kg/m",
    "work on the centre of mass": "J/kg/m",
}
"""Quantity of the whole body -> its unit."""

PHASES = "phase, ipsilateral", "phase, contralateral"
"""Quantities that are circular, in [0, 1)."""

EACH = {
    "vertical impulse": "% W",
    "fore-aft impulse": "% W",
    "inward impulse": "% W",
    "vertical peak of a leg": "W",
    **{f"{joint} torque": "mN mm" for joint in JOINTS},
    "coxa-trochanter torque past half its peak, from": "% of stance",
    "coxa-trochanter torque past half its peak, until": "% of stance",
    "height of the coxae": "mm",
}
"""Quantity of each pair of legs -> its unit (W is the body weight); impulses are sums over both legs."""

UNITS = WHOLE | {f"{name}, {segment}": unit for name, unit in EACH.items() for segment in SEGMENTS}
"""Quantity of the whole body or of one pair of legs -> its unit."""

FRAME = 0.04
"""Averaging time of speed and height, as in a film of 25 frames per second [s]."""

PLATE = 0.01
"""Averaging time of forces and torques, as of a force plate [s]."""

HOP = 0.12
"""Minimum duration of a swing, as a fraction of the time that a protraction from PEP_0 to AEP_0 takes."""


@dataclass(frozen=True, eq=False)
class Strides:
    """Whole strides of one start, from one lift-off of leg 1 to a later one; each row is a physics step."""

    settled: "Settled"
    """All starts at rest, with the compiled body."""
    count: int
    """Number of strides."""
    qpos: np.ndarray
    """(row, position) MuJoCo's `qpos` before each physics step."""
    velocity: np.ndarray
    """(row, 3) mean velocity of the root during the previous physics step, in the world [mm/s]."""
    turning: np.ndarray
    """(row, joint) mean angular velocity of each joint during the previous physics step [rad/s]."""
    torques: np.ndarray
    """(row, joint) mean torque of each servo, damping included, during the previous physics step [g mm^2/s^2]."""
    standing: np.ndarray
    """(row, leg) whether each foot is in contact with the ground."""
    centre: np.ndarray
    """(row, 3) position of the centre of mass in the world [mm]."""
    ground: np.ndarray
    """(sample, leg, 3) force of the ground on each foot, in the world, once per step of the plan [g mm/s^2]."""

    @property
    def step(self) -> float:
        """Duration of a physics step [s]."""
        return self.settled.compiled.model.opt.timestep

    def averaged(self, values: np.ndarray, time: float, every: int = 1) -> np.ndarray:
        """Return moving means over a time [s] of values, (n,), of which there is one in `every` rows."""
        width = max(1, round(time / self.step / every))
        return np.convolve(values, np.ones(width) / width, "valid")

    def lifted(self, leg: int) -> np.ndarray:
        """Return the rows in which a leg begins to swing; the first stride is taken to follow the last one again."""
        rows = len(self.standing)
        found = onsets(np.tile(self.standing[:, leg], 3), rows_of_a_hop(self.settled))
        return found[(found >= rows) & (found < 2 * rows)] - rows

    def stances(self, leg: int) -> list[np.ndarray]:
        """Return the rows of each stance of a leg; the first stride is taken to follow the last one again."""
        standing, rows, lifted = self.standing[:, leg], len(self.standing), self.lifted(leg)
        strides = [np.arange(a, b) % rows for a, b in pairwise([*lifted, *(lifted[:1] + rows)])]
        return [stride[standing[stride].argmax() :] for stride in strides]


def last_strides(
    settled: "Settled", walks: WalkSettings, measured: float, **execution: Any
) -> Iterator[tuple[int, Strides]]:
    """Walk, and yield the index of each start that does not fall with its whole strides at the end of the walk.

    Args:
        settled: starts at rest, with sensors of the feet's forces.
        walks: settings of the walks.
        measured: duration of the end of the walk from which strides are taken [time units].
        execution: threads and progress, see `drive`.
    """
    from hexmj.physics.rollout import drive

    plan = begin(walks.controller, settled.starts, walks.velocity, settled.stride, None, execution.get("threads"))
    first = (walks.duration - measured) / settled.stride.dt * settled.substeps
    chunks = [chunk for chunk in drive(settled, plan, walks.duration, **execution) if chunk.first >= first]
    for start in chunks[-1].ids[~chunks[-1].fell] if chunks else ():
        standing = np.concatenate([chunk.standing[chunk.ids == start][0, :, 0] for chunk in chunks])
        begun = onsets(standing, rows_of_a_hop(settled))
        begun = begun[begun > 1]  # drop strides that begin at rest
        if len(begun) > 1:
            yield int(start), strides_between(settled, chunks, start, begun)


def strides_between(settled: "Settled", chunks: "Sequence[Chunk]", start: int, begun: np.ndarray) -> Strides:
    """Return the strides of one start between `begun`, the rows of consecutive chunks in which leg 1 lifts off.

    `begun` has at least two rows, none of which is 0 or 1.
    """
    columns, rows = settled.compiled.columns, slice(begun[0], begun[-1])
    qpos, sensors, torque, standing = (
        np.concatenate([getattr(chunk, name)[chunk.ids == start][0] for chunk in chunks])
        for name in ("qpos", "sensors", "torque", "standing")
    )
    moved = np.diff(qpos, axis=0) / settled.compiled.model.opt.timestep  # row t: mean velocity from row t to t + 1
    before = slice(begun[0] - 1, begun[-1] - 1)
    return Strides(
        settled=settled,
        count=len(begun) - 1,
        qpos=qpos[rows],
        velocity=moved[before, :3],
        turning=moved[before, columns.qpos],
        torques=torque[before],
        standing=standing[rows],
        centre=sensors[rows, columns.centre_of_mass],
        ground=-sensors[rows][:: settled.substeps, columns.feet_push].reshape(-1, 6, 3),
    )


def rows_of_a_hop(settled: "Settled") -> float:
    """Return the minimum duration of a swing, see `HOP`, in physics steps."""
    stride, step = settled.stride, settled.compiled.model.opt.timestep
    return HOP * (stride.aep0 - stride.pep0) / settled.conditions.vp / step


def onsets(standing: np.ndarray, hop: float) -> np.ndarray:
    """Return the rows in which a foot leaves the ground for more than `hop` rows, given whether it stands, (row,)."""
    changes = np.flatnonzero(standing[1:] != standing[:-1]) + 1
    lifted = changes[~standing[changes]]
    landed = np.append(changes[standing[changes]], len(standing))
    return lifted[landed[np.searchsorted(landed, lifted)] - lifted > hop]


def quantity_table(
    walks: WalkSettings, measured: float, threads: int | None = None, progress: Progress | None = None
) -> "xr.Dataset":
    """Compute a cell of the study: `value` over (quantity, start), NaN for a start that falls or has no whole stride.

    Args:
        walks: settings of the walks.
        measured: duration of the end of the walk from which strides are taken [time units].
        threads: number of threads, by default one per core.
        progress: called with the fraction done since the last call.
    """
    import xarray as xr

    from hexmj.physics.settle import Settling

    settled = Settling(walks.conditions, walks.stride, threads, pushes=True).at(walks.starts)
    values = np.full((len(UNITS), walks.n_starts), np.nan)
    for start, strides in last_strides(settled, walks, measured, threads=threads, progress=progress):
        values[:, start] = list(quantities(strides).values())
    return xr.Dataset({"value": (("quantity", "start"), values, {"units": "of the quantity"})}, {"quantity": [*UNITS]})


def quantities(strides: Strides) -> dict[str, float]:
    """Return the value of every quantity in `UNITS`; NaN if the body lacks the joints or a leg never carries weight."""
    parts = (_gait, _forces, _torques, _posture, _work)
    values = {name: value for part in parts for name, value in part(strides).items()}
    for name in EACH.keys() & values.keys():
        pairs = np.reshape(values.pop(name), (2, 3)).mean(axis=0)
        values |= {f"{name}, {segment}": value for segment, value in zip(SEGMENTS, pairs, strict=True)}
    return {name: float(values.get(name, np.nan)) for name in UNITS}


def _gait(strides: Strides) -> dict[str, Any]:
    carries = strides.ground[..., 2] > 0
    ahead, duty = _ahead(strides), carries[:, carries.any(axis=0)].mean()
    speed, period = ahead.mean(), len(ahead) * strides.step / strides.count
    begun = [np.append(strides.lifted(leg), np.nan)[0] for leg in range(6)]
    lags = [(begun[k] - begun[j]) * strides.step / period % 1.0 for j, k in PAIRS.values()]
    return {
        "speed": speed,
        "ripple: least over mean speed": strides.averaged(ahead, FRAME).min() / speed,
        "period": period,
        "duty factor": duty,
        "way of a standing foot": speed * period * duty,
        "phase, ipsilateral": circular_mean(lags[IPSILATERAL]),
        "phase, contralateral": circular_mean(lags[CONTRALATERAL]),
    }


def _forces(strides: Strides) -> dict[str, Any]:
    """Return the quantities of the forces of the ground on the feet, in the directions of the body's heading."""
    share = strides.ground / strides.settled.compiled.weight
    level = turned(share[..., :2], -heading(strides.qpos[:: strides.settled.substeps, 3:7]))
    ahead, inward, up = level[..., 0], -np.array(SIDE) * level[..., 1], share[..., 2]
    peaks = np.array([strides.averaged(leg, PLATE, strides.settled.substeps).max() for leg in up.T])
    peaks = np.where((up > 0).any(axis=0), peaks, np.nan)
    pairs = peaks.reshape(2, 3).mean(axis=0)
    impulses = {"vertical": up, "fore-aft": ahead, "inward": inward}
    return {f"{name} impulse": 200.0 * force.mean(axis=0) for name, force in impulses.items()} | {
        "vertical peak of a leg": peaks,
        "vertical peaks: greatest over least": pairs.max() / pairs.min(),
    }


def _torques(strides: Strides) -> dict[str, Any]:
    """Return torque and work of the servos of standing legs; nothing for a body whose legs do not have three joints."""
    torque = strides.torques.reshape(len(strides.torques), 6, -1)
    if torque.shape[2] != len(JOINTS):
        return {}
    power, stands = torque * strides.turning.reshape(torque.shape), strides.standing[..., None]
    with np.errstate(invalid="ignore"):  # a leg that never stands gives 0 / 0
        mean = np.abs(torque).sum(axis=0, where=stands) / stands.sum(axis=0)
    work = (np.maximum(power, 0.0) * stands).sum(axis=(0, 1))
    course = [_course(torque[:, leg, 1], strides, leg) for leg in range(6)]
    past = [np.flatnonzero(torques > 0.5 * torques.max()) for torques in course]
    return {
        **{f"{joint} torque": 1e-3 * legs for joint, legs in zip(JOINTS, mean.T, strict=True)},
        "work of standing legs at the coxa-trochanter": 100.0 * work[1] / work.sum(),
        "coxa-trochanter torque past half its peak, from": [rows[0] if len(rows) else np.nan for rows in past],
        "coxa-trochanter torque past half its peak, until": [rows[-1] if len(rows) else np.nan for rows in past],
    }


def _course(torque: np.ndarray, strides: Strides, leg: int) -> np.ndarray:
    """Return a leg's torque, (row,), at each percent of a stance, (101,), averaged over stances; NaN without stances.

    The sign is chosen so that the mean torque over the stance is positive.
    """
    around = np.pad(torque, n := round(PLATE / strides.step), mode="wrap")
    seen = np.convolve(around, np.ones(n) / n, "same")[n:-n]
    percent, stances = np.linspace(0.0, 1.0, 101), [seen[rows] for rows in strides.stances(leg)]
    courses = [np.interp(percent, np.linspace(0.0, 1.0, len(stance)), stance) for stance in stances]
    mean = np.mean(courses, axis=0) if courses else np.full(101, np.nan)
    return mean * np.sign(mean.mean())


def _posture(strides: Strides) -> dict[str, Any]:
    """Return the heights of the coxae, and the pitch of the line from hind to front coxae."""
    from hexmj.bodies.ground import ground_level
    from hexmj.bodies.kinematics import joint_numbers, posed

    compiled = strides.settled.compiled
    first = joint_numbers(compiled.model, compiled.body)[:, 0]
    coxae = posed(compiled.model, compiled.home).xpos[compiled.model.jnt_bodyid[first]]  # (leg, 3) in the root frame
    places = strides.qpos[:, None, :3] + rotated(strides.qpos[:, None, 3:7], coxae)
    below = [ground_level(compiled.conditions, places[:, leg, :2]) for leg in range(6)]
    height = places[..., 2] - compiled.foot_radius
    rise = height.reshape(-1, 2, 3).mean(axis=1)[:, [0, 2]] @ [1.0, -1.0]
    pitch = np.degrees(np.arcsin(rise / np.linalg.norm((coxae[0] - coxae[2])[[0, 2]])))
    return {
        "height of the coxae": (height - np.maximum(np.stack(below, axis=1), 0.0)).mean(axis=0),
        "pitch of the thorax": pitch.mean(),
    }


def _work(strides: Strides) -> dict[str, Any]:
    """Return work per own weight (without load) and distance; only 'all work' adds joints' negative work, as a cost."""
    power, compiled = strides.torques * strides.turning, strides.settled.compiled
    gravity = compiled.weight / compiled.body.mass
    rate = compiled.weight * _ahead(strides).mean()
    positive = np.maximum(power, 0.0).sum(axis=1).mean() / rate
    centre = np.stack([strides.averaged(axis, FRAME) for axis in strides.centre.T], axis=1)
    speed = np.linalg.norm(np.diff(centre, axis=0), axis=1) / strides.step
    gained = np.maximum(np.diff(0.5 * speed**2 + gravity * centre[1:, 2]), 0.0).sum()
    gained *= 1.0 + compiled.conditions.load  # the load moves with the body
    return {
        "cost of transport, positive work": positive,
        "cost of transport, all work": np.abs(power).sum(axis=1).mean() / rate,
        "positive work of the joints": 1e-3 * gravity * positive,
        "work on the centre of mass": 1e-3 * gained / np.linalg.norm(centre[-1, :2] - centre[0, :2]),
    }


def _ahead(strides: Strides) -> np.ndarray:
    """Return the speed of the root in the direction of its heading, (row,) [mm/s]."""
    return turned(strides.velocity[:, None, :2], -heading(strides.qpos[:, 3:7]))[:, 0, 0]
