"""What is measured of strides: gait, forces, torques, posture and work, one number each."""

from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.bodies.compiled import CompiledBody
from hexmj.bodies.grounds import ground_level
from hexmj.bodies.reading import joint_numbers, posed
from hexmj.legs import SIDE
from hexmj.measures.walk_settings import WalkSettings
from hexmj.phases import CONTRALATERAL, IPSILATERAL, PAIRS, circular_mean
from hexmj.physics.settling import Settling
from hexmj.rotations import heading, rotated, turned
from hexmj.studies.biology.names import EACH, JOINTS, SEGMENTS, UNITS
from hexmj.studies.biology.strides import Strides, last_strides
from hexmj.threads import check_memory

if TYPE_CHECKING:
    import xarray as xr

FRAME = 0.04
"""Speed, height and pitch are means over so long, as a film of 25 frames a second shows them [s]."""

PLATE = 0.01
"""And peaks of forces over so long, as a force plate shows them [s]."""

KEPT = 1100
"""Memory that a physics step of a start takes until all have walked [bytes]; the arrays of a chunk are 1046."""

TO_MN_MM, TO_J_PER_KG_M = 1e-3, 1e-3
"""From g mm^2/s^2 and from mm/s^2."""


def quantity_table(walks: WalkSettings, measured: float, threads: int | None = None) -> "xr.Dataset":
    """Every quantity of every start, over (quantity, start), within the last time that is `measured` [time units]; NaN
    where the start fell.

    Raises:
        InputError: the strides do not fit into memory.
    """
    import xarray as xr

    n_starts, conditions, stride = walks.n_starts, walks.conditions, walks.stride
    steps = measured / stride.dt * conditions.substeps(stride)
    check_memory(f"the last strides of {n_starts} starts", KEPT * steps * n_starts)
    settled = Settling(conditions, stride, threads, pushes=True).at(walks.starts)
    values = np.full((len(UNITS), n_starts), np.nan)
    for start, strides in last_strides(settled, walks.controller, walks.velocity, walks.duration, measured, threads):
        values[:, start] = list(quantities(strides, settled.compiled).values())
    return xr.Dataset({"value": (("quantity", "start"), values, {"units": "of the quantity"})}, {"quantity": [*UNITS]})


def quantities(strides: Strides, compiled: CompiledBody) -> dict[str, float]:
    """Every quantity by its name; NaN where legs have not the joints for it, as are torques and peaks of a leg that
    never carries."""
    parts = (_gait, _forces, _torques, _posture, _work)
    told = {name: value for part in parts for name, value in part(strides, compiled).items()}
    for name in EACH.keys() & told.keys():
        pairs = np.reshape(told.pop(name), (2, 3)).mean(axis=0)
        told |= {f"{name}, {segment}": value for segment, value in zip(SEGMENTS, pairs, strict=True)}
    return {name: float(told.get(name, np.nan)) for name in UNITS}


def _gait(strides: Strides, compiled: CompiledBody) -> dict[str, Any]:
    carries = strides.ground[..., 2] > 0
    ahead, duty = _ahead(strides), carries[:, carries.any(axis=0)].mean()
    speed, period = ahead.mean(), len(ahead) * strides.step / strides.count
    begun = [np.append(strides.lifted(leg), np.nan)[0] for leg in range(6)]
    lags = [(begun[k] - begun[j]) * strides.step / period % 1.0 for j, k in PAIRS.values()]
    return {
        "speed": speed,
        "ripple: least over mean speed": _seen(ahead, FRAME / strides.step).min() / speed,
        "period": period,
        "duty factor": duty,
        "way of a standing foot": speed * period * duty,
        "phase, ipsilateral": circular_mean(lags[IPSILATERAL]),
        "phase, contralateral": circular_mean(lags[CONTRALATERAL]),
    }


def _forces(strides: Strides, compiled: CompiledBody) -> dict[str, Any]:
    """Of the ground on the feet, seen along the body's heading."""
    share = strides.ground / compiled.weight
    level = turned(share[..., :2], -heading(strides.qpos[:: strides.every, 3:7]))
    ahead, inward, up = level[..., 0], -np.array(SIDE) * level[..., 1], share[..., 2]
    peaks = np.array([_seen(leg, PLATE / strides.step / strides.every).max() for leg in up.T])
    peaks = np.where((up > 0).any(axis=0), peaks, np.nan)
    pairs = peaks.reshape(2, 3).mean(axis=0)
    impulses = {"vertical": up, "fore-aft": ahead, "inward": inward}
    return {f"{name} impulse": 200.0 * force.mean(axis=0) for name, force in impulses.items()} | {
        "vertical peak of a leg": peaks,
        "vertical peaks: greatest over least": pairs.max() / pairs.min(),
    }


def _torques(strides: Strides, compiled: CompiledBody) -> dict[str, Any]:
    """Of the servos while their leg stands, and the work they do then."""
    torque, power = (one.reshape(len(one), 6, -1) for one in (strides.torques, strides.torques * strides.turning))
    if torque.shape[2] != len(JOINTS):
        return {}
    stands = strides.standing[..., None]
    with np.errstate(invalid="ignore"):  # of a leg that never stands
        mean = np.abs(torque).sum(axis=0, where=stands) / stands.sum(axis=0)
    against = ((power < 0) & stands).sum(axis=(0, 1)) / strides.standing.sum()
    work = (np.maximum(power, 0.0) * stands).sum(axis=(0, 1))
    course = [_course(torque[:, leg, 1], strides, leg) for leg in range(6)]
    past = [np.flatnonzero(one > 0.5 * one.max()) for one in course]
    return {
        **{f"{joint} torque": TO_MN_MM * legs for joint, legs in zip(JOINTS, mean.T, strict=True)},
        **{f"{joint} torque against its movement": 100.0 * one for joint, one in zip(JOINTS, against, strict=True)},
        "work of standing legs at the coxa-trochanter": 100.0 * work[1] / work.sum(),
        "coxa-trochanter torque past half its peak, from": [one[0] if len(one) else np.nan for one in past],
        "coxa-trochanter torque past half its peak, until": [one[-1] if len(one) else np.nan for one in past],
    }


def _course(torque: np.ndarray, strides: Strides, leg: int) -> np.ndarray:
    """Of a leg's torque, (row,), at each percent of its stance, (101,), as a force plate would show it: positive where
    it carries the body, in the mean over whole stances; NaN without one.  The strides follow one another in a ring."""
    around = np.pad(torque, n := round(PLATE / strides.step), mode="wrap")
    seen = np.convolve(around, np.ones(n) / n, "same")[n:-n]
    percent, stances = np.linspace(0.0, 1.0, 101), [seen[rows] for rows in strides.stances(leg)]
    courses = [np.interp(percent, np.linspace(0.0, 1.0, len(one)), one) for one in stances]
    mean = np.mean(courses, axis=0) if courses else np.full(101, np.nan)
    return mean * np.sign(mean.mean())


def _posture(strides: Strides, compiled: CompiledBody) -> dict[str, Any]:
    """Heights of the coxae over tips that stand below them, or beside a gap; the thorax lies from the hind coxae to the
    front ones."""
    coxae = _coxae(compiled)
    places = strides.qpos[:, None, :3] + rotated(strides.qpos[:, None, 3:7], coxae)
    below = [ground_level(compiled.conditions, places[:, leg, :2]) for leg in range(6)]
    height = places[..., 2] - compiled.foot_radius
    rise = height.reshape(-1, 2, 3).mean(axis=1)[:, [0, 2]] @ [1.0, -1.0]
    pitch = np.degrees(np.arcsin(rise / np.linalg.norm((coxae[0] - coxae[2])[[0, 2]])))
    return {
        "height of the coxae": (height - np.maximum(np.stack(below, axis=1), 0.0)).mean(axis=0),
        "pitch of the thorax": pitch.mean(),
        "pitch, range over the strides": np.ptp(_seen(pitch, FRAME / strides.step)),
        "height of the centre of mass, range over the strides": np.ptp(
            _seen(strides.centre[:, 2], FRAME / strides.step)
        ),
    }


def _work(strides: Strides, compiled: CompiledBody) -> dict[str, Any]:
    """Work over the insect's own weight, whatever it carries, and way; negative work of a joint is lost, and costs
    nothing or as much as positive work."""
    power, gravity = strides.torques * strides.turning, compiled.weight / compiled.body.mass
    rate = compiled.weight * _ahead(strides).mean()
    positive = np.maximum(power, 0.0).sum(axis=1).mean() / rate
    centre = np.stack([_seen(one, FRAME / strides.step) for one in strides.centre.T], axis=1)
    speed = np.linalg.norm(np.diff(centre, axis=0), axis=1) / strides.step
    gained = np.maximum(np.diff(0.5 * speed**2 + gravity * centre[1:, 2]), 0.0).sum()
    gained *= 1.0 + compiled.conditions.load  # which moves with it
    return {
        "cost of transport, positive work": positive,
        "cost of transport, all work": np.abs(power).sum(axis=1).mean() / rate,
        "positive work of the joints": TO_J_PER_KG_M * gravity * positive,
        "work on the centre of mass": TO_J_PER_KG_M * gained / np.linalg.norm(centre[-1, :2] - centre[0, :2]),
    }


def _ahead(strides: Strides) -> np.ndarray:
    """Speed of the root along its heading, (row,) [mm/s]."""
    return turned(strides.velocity[:, None, :2], -heading(strides.qpos[:, 3:7]))[:, 0, 0]


def _coxae(compiled: CompiledBody) -> np.ndarray:
    """Where the parts that the legs' first joints move begin in the root frame, (leg, 3) [mm]."""
    first = joint_numbers(compiled.model, compiled.body)[:, 0]
    return posed(compiled.model, compiled.home).xpos[compiled.model.jnt_bodyid[first]]


def _seen(values: np.ndarray, observation_time: float) -> np.ndarray:
    """Means over a observation time [rows] of values, (row,); fewer than these."""
    width = max(1, round(observation_time))
    return np.convolve(values, np.ones(width) / width, "valid")
