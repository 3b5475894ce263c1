"""Dynamic stability maps: physical FLSS over the velocity and one condition of the body, with the same starts."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.cells import kept
from hexmj.comparison import MEASURES, UNITS
from hexmj.errors import InputError, SimulationError
from hexmj.experiments.mechanisms import MECHANISMS, fall_direction, mechanisms, static_plan
from hexmj.intervals import paired_difference, wilson_intervals
from hexmj.loss_frequency import checked_list, draw_starts, observation_time, settings
from hexmj.parameters import Acceleration, Model, Network
from hexmj.physics.body import Body
from hexmj.physics.insect import GRAVITY
from hexmj.physics.measurement import Outcomes
from hexmj.physics.physical_walks import physical_walk
from hexmj.physics.settling import settle
from hexmj.progress import Progress
from hexmj.stability import loss_time

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Condition:
    """A condition of the body that a map can vary."""

    values: tuple[float, ...]
    """Those of a map unless others are given."""
    unit: str
    name: str


CONDITIONS = {
    "vp": Condition((20.0, 40.0, 80.0, 160.0, 320.0), "mm/s", "swing velocity V_p"),
    "step_height": Condition((4.0, 6.0, 8.0, 10.0, 12.0), "mm", "step height"),
    "standing_height": Condition((6.0, 8.0, 10.0, 12.0, 14.0), "mm", "standing height"),
    "friction": Condition((0.05, 0.2, 0.5, 1.0, 2.0), "1", "friction"),
    "load": Condition((0.0, 0.5, 1.0, 1.5, 2.0), "insect's weight", "load"),
    "centre_of_mass": Condition((-9.4, -5.0, 0.0, 5.0, 10.0), "mm", "centre of mass ahead of O"),
}
"""Field of `Body` -> its values, unit and name; the animal's own centre of mass lies at -9.4 mm."""

FLSS = MEASURES | {"static": "static_loss"}
"""Measure -> the outcome whose frequency it is.  `static` is the planned polygon around the body's own centre of mass;
`kinematic` the same around O, which knows no condition."""

BLOCK = 100
"""Starts walked at a time: their walks are kept whole, 0.4 GB at V = 0.1."""


def stability_map(
    model: Model,
    over: str,
    folder: Path,
    *,
    values: Sequence[float] = (),
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7),
    starts: int = 100,
    window: str | float = "walk",
    seed: int = 0,
    body: Body | None = None,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Walk the same starts at every value of a condition and every velocity; what is finished is not walked again.

    Args:
        model: coupling weights.
        over: the condition that is varied, one of `CONDITIONS`.
        folder: keeps one file for each value and velocity.
        values: of the condition, each once; those of `CONDITIONS` unless given.
        velocities: V_r (when accelerating, its final value), each 0 <= V < 1.
        starts: number of starts; those that cannot stand on six feet at every value are left out of the result.
        window: 'walk', 'start' or the observation time itself [time units].
        seed: of the starts.
        body: all other conditions.
        network: the constants that the paper leaves out.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Returns:
        Over (value, velocity): the measures of `FLSS` and `saved`, the fraction of the starts with a static loss that
        do not fall, with their 95 % Wilson intervals; the paired differences `dynamics`, physical less static, and
        `change` of physical from the value in `attrs["reference"]`, with 95 % intervals; the Froude number `froude`;
        over mechanism too the numbers of starts, `count`.  Over (value, velocity, start): every field of `Outcomes`,
        `static_loss`, `mechanism` (index) and `direction` of the fall [rad].  Over value: how many starts `stand`.

    Raises:
        InputError, SimulationError: a condition, value or velocity that makes no sense; no start that stands at every
            value; a walk that diverges.
    """
    import xarray as xr

    body, network, v = body or Body(), network or Network(), checked_list(velocities)
    bodies = _bodies(over, values, body)
    duration = observation_time(window, v, network, acceleration)
    told = settings({"model": model}, window, starts, seed, network, acceleration)
    work = np.outer([one.substeps(network) for one in bodies.values()], duration)

    def cell(one: Body, i: int, share: float) -> "xr.Dataset":
        def compute() -> "xr.Dataset":
            conditions: Any = {"network": network, "acceleration": acceleration, "threads": threads}
            x = draw_starts(starts, seed, network)
            stands = np.flatnonzero(_stands(x, one, network))
            if not stands.size:
                raise InputError(f"{over} = {getattr(one, over):g}; none of {starts} starts stands on six feet there")
            outcomes = _outcomes(x[stands], model, float(v[i]), float(duration[i]), one, conditions)
            return outcomes.assign_coords(start=stands)

        name = f"{over}-{getattr(one, over):g}-v-{v[i]:g}"
        data = kept(folder, name, told | {"velocity": float(v[i]), "body": asdict(one)}, compute)
        if progress:
            progress(share)
        return data

    shares = work / work.sum()
    table = [[cell(one, i, shares[n, i]) for i in range(len(v))] for n, one in enumerate(bodies.values())]
    stand = [row[0].sizes["start"] for row in table]
    rows = [xr.concat(row, "velocity", join="inner", combine_attrs="override") for row in table]
    data = xr.concat(rows, "value", join="inner", combine_attrs="override").assign_coords(
        value=("value", list(bodies), {"units": CONDITIONS[over].unit, "long_name": CONDITIONS[over].name}),
        velocity=("velocity", v, {"units": "V_p", "long_name": "velocity V_r"}),
        duration=("velocity", duration, {"units": "time unit", "long_name": "observation time t"}),
        mechanism_name=("mechanism_name", list(MECHANISMS)),
    )
    if not data.sizes["start"]:
        raise InputError(f"{over} = {list(bodies)}; none of {starts} starts stands on six feet at all of them")
    reference = getattr(Body, over) if getattr(Body, over) in bodies else next(iter(bodies))
    data = _with_frequencies(data, reference).assign(
        stand=("value", stand, {"units": "1", "long_name": "starts that stand on six feet"}),
        froude=(("value", "velocity"), [froude(one, v) for one in bodies.values()], {"units": "1"}),
    )
    others = {name: value for name, value in asdict(body).items() if name != over}
    data.attrs = told | {"over": over, "reference": reference, "body": others}
    return data


def froude(body: Body, velocity: np.ndarray) -> np.ndarray:
    """The Froude number (V V_p)^2 / (g h) at each V_r, (velocity,); h is the standing height."""
    return (velocity * body.vp) ** 2 / (GRAVITY * body.standing_height)


def _bodies(over: str, values: Sequence[float], body: Body) -> dict[float, Body]:
    """The body at each value of the condition, if that is one of a map's and every value makes sense."""
    if over not in CONDITIONS:
        raise InputError(f"over = {over!r}; valid names: {', '.join(CONDITIONS)}")
    if body.feedback:
        raise InputError("feedback = True; expected False: mechanisms are told from the plan that the body follows")
    values = [float(value) for value in values or CONDITIONS[over].values]
    if len(set(values)) < len(values):
        raise InputError(f"values = {values}; expected none of them twice")
    return {value: replace(body, **{over: value}) for value in values}


def _outcomes(
    x: np.ndarray, model: Model, velocity: float, duration: float, body: Body, conditions: dict[str, Any]
) -> "xr.Dataset":
    """What happened to every start."""
    import xarray as xr

    parts: list[dict[str, np.ndarray]] = []
    for block in np.split(x, range(BLOCK, len(x), BLOCK)):
        walk = physical_walk(block, model, velocity, duration, body=body, **conditions)
        part = {field.name: getattr(walk.outcomes, field.name) for field in fields(Outcomes)}
        static_loss = loss_time(static_plan(walk), threads=conditions["threads"])
        more = {"static_loss": static_loss, "mechanism": mechanisms(walk), "direction": fall_direction(walk)}
        parts.append(part | more)
    units = UNITS | {"static_loss": "time unit", "direction": "rad"}
    return xr.Dataset(
        {
            name: ("start", np.concatenate([part[name] for part in parts]), {"units": units.get(name, "1")})
            for name in parts[0]
        }
    )


def _stands(x: np.ndarray, body: Body, network: Network) -> np.ndarray:
    """Which starts come to rest on six feet, (start,)."""
    try:
        settle(x, body, network)
    except SimulationError:
        if len(x) == 1:
            return np.array([False])
        return np.concatenate([_stands(half, body, network) for half in np.array_split(x, 2)])
    return np.ones(len(x), dtype=bool)


def _with_frequencies(data: "xr.Dataset", reference: float) -> "xr.Dataset":
    """The frequencies, differences and counts beside the outcomes of every start."""
    cells = ("value", "velocity")
    happened = {
        measure: np.isfinite(data[outcome].transpose(*cells, "start").values) for measure, outcome in FLSS.items()
    }
    new: dict[str, Any] = {}

    def put(name: str, middle: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
        for end, numbers in (("", middle), ("_low", low), ("_high", high)):
            new[name + end] = (cells, numbers, {"units": "1"})

    size = data.sizes["start"]
    for measure, lost in happened.items():
        put(measure, lost.mean(axis=-1), *wilson_intervals(lost.sum(axis=-1), size))
    fell, static = happened["physical"], happened["static"]
    lost, saved = static.sum(axis=-1), (static & ~fell).sum(axis=-1)
    put("saved", np.where(lost > 0, saved / np.maximum(lost, 1), np.nan), *wilson_intervals(saved, lost))
    put("dynamics", *paired_difference(fell, static))
    row = data.value.values.tolist().index(reference)
    put("change", *paired_difference(fell, np.broadcast_to(fell[row], fell.shape)))
    names = data.mechanism.transpose(*cells, "start").values
    count = np.stack([(names == number).sum(axis=-1) for number in range(len(MECHANISMS))], axis=-1)
    new["count"] = ((*cells, "mechanism_name"), count, {"units": "1", "long_name": "number of starts"})
    return data.assign(new)
