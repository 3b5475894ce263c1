"""The two measures of stability on the same starts: polygon on paper, polygon under the body, body on the ground."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from hexmj.errors import InputError
from hexmj.intervals import wilson_intervals
from hexmj.legs import LEGS
from hexmj.loss_frequency import (
    checked_list,
    draw_starts,
    frequency_table,
    losses_by_sample,
    observation_time,
    settings,
)
from hexmj.parameters import Acceleration, Model, Network
from hexmj.physics.body import Body
from hexmj.physics.insect import TRUNK
from hexmj.physics.measurement import Outcomes
from hexmj.physics.physical_walks import physical_outcomes
from hexmj.physics.settling import settle
from hexmj.presets import PRESETS
from hexmj.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

MEASURES = {"kinematic": "planned_loss", "measured": "measured_loss", "physical": "fall"}
"""Measure of FLSS -> the outcome whose frequency it is."""

AGREEMENT = ("both", "only_kinematic", "only_physical", "none")
"""What a start can do: lose stability on paper, touch the ground, both or none."""

REPORTED = ("clearance", "tilt", "speed", "slip", "tracking", "depth", "saturation", "unreachable")
"""Outcomes that tell how far the bodies did what they were told."""

UNITS = {
    "planned_loss": "time unit",
    "measured_loss": "time unit",
    "fall": "time unit",
    "clearance": "mm",
    "tilt": "rad",
    "slip": "mm/s",
    "tracking": "mm",
    "depth": "mm",
}
"""Units of the outcomes; the others are numbers."""


def compare(
    models: Model | Mapping[str, Model],
    velocities: Sequence[float],
    *,
    starts: int = 60,
    window: str | float = "walk",
    seed: int = 0,
    body: Body | None = None,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Kinematic, measured and physical FLSS of one or more models over velocities, on the same starts.

    Args:
        models: coupling weights, or several by name.
        velocities: V_r (when accelerating, its final value), each 0 <= V < 1.
        starts: number of starts, the same for every model and velocity.
        window: 'walk', 'start' or the observation time itself [time units].
        seed: of the starts.
        body: conditions of the physical walks.
        network: the constants that the paper leaves out.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Returns:
        Over (model, velocity): the three FLSS with their 95 % Wilson intervals (`kinematic`,
        `kinematic_low`, ...), the numbers of starts in each case of `AGREEMENT` and `agreement`, the
        fraction of starts for which kinematic and physical answer are the same; over (model, velocity,
        start) every field of `Outcomes`.

    Raises:
        InputError, SimulationError: see `settling.settle` and `physics.drive`.
    """
    import xarray as xr

    network, body, v = network or Network(), body or Body(), checked_list(velocities)
    named = dict(models) if isinstance(models, Mapping) else {_name(models): models}
    if not named:
        raise InputError("no model was given; expected at least one")
    duration = observation_time(window, v, network, acceleration)
    settled = settle(draw_starts(starts, seed, network), body, network, threads)
    share = duration / duration.sum() / len(named)

    def outcomes(model: Model, i: int) -> Outcomes:
        def tick(done: float) -> None:
            if progress:
                progress(done * share[i])

        return physical_outcomes(
            settled, model, v[i], duration[i], acceleration=acceleration, threads=threads, progress=tick
        )

    table = [[outcomes(model, i) for i in range(len(v))] for model in named.values()]
    data = xr.Dataset(
        coords={
            "model": list(named),
            "velocity": ("velocity", v, {"units": "V_p", "long_name": "velocity V_r"}),
            "duration": ("velocity", duration, {"units": "time unit", "long_name": "observation time t"}),
            "leg": list(LEGS),
            "starts": (("start", "leg"), settled.starts, {"units": "mm", "long_name": "tips at the start"}),
        }
    )
    for field in fields(Outcomes):
        values = np.array([[getattr(o, field.name) for o in row] for row in table])
        data[field.name] = (("model", "velocity", "start"), values, {"units": UNITS.get(field.name, "1")})
    data.fall_part.attrs["flag_meanings"] = " ".join(TRUNK)
    data = with_frequencies(data)
    kinematic, physical = data.planned_loss < np.inf, data.fall < np.inf
    cases = (kinematic & physical, kinematic & ~physical, ~kinematic & physical, ~kinematic & ~physical)
    for case, true in zip(AGREEMENT, cases, strict=True):
        data[case] = true.sum("start").assign_attrs(units="1", long_name="number of starts")
    data.attrs = settings(named, window, starts, seed, network, acceleration, body)
    return data


def with_frequencies(data: "xr.Dataset") -> "xr.Dataset":
    """The FLSS of `MEASURES` with 95 % Wilson intervals, and `agreement`, beside outcomes over (..., start)."""
    new: dict[str, xr.DataArray] = {}
    for measure, outcome in MEASURES.items():
        lost = data[outcome] < np.inf
        new[measure] = lost.mean("start").assign_attrs(units="1", long_name=f"{measure} FLSS")
        ends = wilson_intervals(lost.sum("start").values, data.sizes["start"])
        for end, values in zip(("_low", "_high"), ends, strict=True):
            new[measure + end] = new[measure].copy(data=values).drop_attrs().assign_attrs(units="1")
    same = (data.planned_loss < np.inf) == (data.fall < np.inf)
    new["agreement"] = same.mean("start").assign_attrs(units="1", long_name="kinematic and physical answer agree")
    return data.assign(new)


def physical_flss(
    model: Model,
    velocities: Sequence[float],
    *,
    starts: int = 200,
    window: str | float = "walk",
    seed: int = 0,
    body: Body | None = None,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Physical FLSS: the frequency with which the trunk touches the ground; arguments as for `compare`.

    Returns:
        The table of `loss_frequency.flss`, and the time of the fall and the outcomes `REPORTED` of every start.
    """
    result = compare(
        model,
        velocities,
        starts=starts,
        window=window,
        seed=seed,
        body=body,
        network=network,
        acceleration=acceleration,
        threads=threads,
        progress=progress,
    )
    fell = losses_by_sample(np.isfinite(result.fall.values[0]))
    table = frequency_table(fell, starts, result.velocity.values, result.duration.values)
    reported = result.isel(model=0, drop=True)[["fall", *REPORTED]].drop_vars("duration")
    return table.assign(reported.data_vars).assign_attrs(result.attrs)


def _name(model: Model) -> str:
    return next((name for name, preset in PRESETS.items() if preset is model), "model")
