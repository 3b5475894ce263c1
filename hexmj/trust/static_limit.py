"""The static limit: as V_p goes to zero, does the walking insect tend to the plan and to the paper's static criterion?

The same starts walk at smaller and smaller V_p, with the insect's own legs and with legs that weigh next to nothing,
as the paper has them.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hexmj.cells import kept
from hexmj.comparison import MEASURES, with_frequencies
from hexmj.errors import check_distinct
from hexmj.loss_frequency import draw_starts, observation_time, settings
from hexmj.parameters import Acceleration, Model, Network
from hexmj.physics.body import Body
from hexmj.physics.physical_walks import PhysicalWalk, physical_walk
from hexmj.progress import Progress
from hexmj.stability import walk_margin

if TYPE_CHECKING:
    import xarray as xr

VARIED = ("vp", "leg_mass")
"""Conditions of the body that the lists give."""

DISTANCES = {  # units, long_name
    "margin": ("mm", "mean distance between measured and planned stability margin"),
    "margin_same_feet": ("mm", "the same where the same feet stand"),
    "same_feet": ("1", "fraction of steps in which the same feet stand"),
    "drift": ("mm", "mean distance of the centre of mass from O"),
}
"""How far a measured walk is from its plan; counted until the plan loses stability or the insect falls."""

REPORTED = {"slip": "mm/s", "tracking": "mm"}
"""Other outcomes that are kept, with their units."""


def converge(
    model: Model,
    folder: Path,
    *,
    velocity: float = 0.5,
    vps: Sequence[float] = (400.0, 200.0, 100.0, 50.0, 25.0),
    leg_masses: Sequence[float] = (1.0, 0.01),
    starts: int = 200,
    window: str | float = "walk",
    seed: int = 0,
    body: Body | None = None,
    network: Network | None = None,
    acceleration: Acceleration | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Walk the same starts at every V_p, with every mass of the legs; what is finished is not walked again.

    Args:
        model: coupling weights.
        folder: keeps one file for each V_p and mass.
        velocity: V_r, 0 <= V < 1.
        vps: velocities V_p of a protracting tip [mm/s], each once.
        leg_masses: as `Body.leg_mass`, each once.
        starts: number of starts.
        window: 'walk', 'start' or the observation time itself [time units].
        seed: of the starts.
        body: all other conditions; light legs need physics steps of 0.5 ms or less.
        network: the constants that the paper leaves out.
        acceleration: the accelerating procedure of Eq. 11.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Returns:
        Over (leg_mass, vp): the three FLSS of `comparison.MEASURES` with their 95 % Wilson intervals and `agreement`,
        the fraction of starts for which kinematic and physical answer are the same; over (leg_mass, vp, start) the
        outcomes behind them, `DISTANCES` and `REPORTED`.

    Raises:
        InputError, SimulationError: see `physical_walks.physical_walk`.
    """
    import xarray as xr

    body, network = body or Body(longest_substep=0.5), network or Network()
    check_distinct("vps", vps)
    check_distinct("leg_masses", leg_masses)
    duration = float(observation_time(window, np.array([velocity]), network, acceleration)[0])
    told = settings({"model": model}, window, starts, seed, network, acceleration)
    bodies = [[replace(body, leg_mass=mass, vp=vp) for vp in vps] for mass in leg_masses]
    steps = sum(one.substeps(network) for row in bodies for one in row)

    def cell(one: Body) -> "xr.Dataset":
        def compute() -> "xr.Dataset":
            x, conditions = draw_starts(starts, seed, network), {"network": network, "acceleration": acceleration}
            walk = physical_walk(x, model, velocity, duration, body=one, **conditions, threads=threads)
            return _kept_of(walk)

        whole = told | {"velocity": velocity, "body": asdict(one)}
        data = kept(folder, f"leg-mass-{one.leg_mass:g}-vp-{one.vp:g}", whole, compute)
        if progress:
            progress(one.substeps(network) / steps)
        return data

    rows = [xr.concat([cell(one) for one in row], "vp", combine_attrs="drop") for row in bodies]
    data = xr.concat(rows, "leg_mass").assign_coords(
        vp=("vp", list(vps), {"units": "mm/s", "long_name": "velocity V_p of a protracting tip"}),
        leg_mass=("leg_mass", list(leg_masses), {"units": "1", "long_name": "mass of the legs over the insect's own"}),
    )
    others = {name: value for name, value in asdict(body).items() if name not in VARIED}
    return with_frequencies(data).assign_attrs(told | {"velocity": velocity, "duration": duration, "body": others})


def distances(walk: PhysicalWalk) -> dict[str, np.ndarray]:
    """`DISTANCES` of every start, (start,); NaN where the plan is lost at once."""
    planned, measured, outcomes = walk.planned, walk.measured, walk.outcomes
    compared = planned.time[:, None] < np.minimum(outcomes.planned_loss, outcomes.fall)
    off = np.abs(walk_margin(measured) - walk_margin(planned))
    same = (measured.stance == planned.stance).all(axis=-1)
    drift = np.linalg.norm(walk.centre_of_mass[..., :2] - walk.qpos[..., :2], axis=-1)
    touching = compared & measured.stance.any(axis=-1)  # without any foot there is no margin
    return {
        "margin": _mean(off, touching),
        "margin_same_feet": _mean(off, touching & same),
        "same_feet": _mean(same, compared),
        "drift": _mean(drift, compared),
    }


def _mean(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Mean over the steps `where` it counts, (start,), of (step, start)."""
    with np.errstate(invalid="ignore"):
        return np.where(where, values, 0.0).sum(axis=0) / where.sum(axis=0)


def _kept_of(walk: PhysicalWalk) -> "xr.Dataset":
    import xarray as xr

    lost = {name: ("start", getattr(walk.outcomes, name), {"units": "time unit"}) for name in MEASURES.values()}
    told = {name: ("start", getattr(walk.outcomes, name), {"units": unit}) for name, unit in REPORTED.items()}
    off = {
        name: ("start", values, dict(zip(("units", "long_name"), DISTANCES[name], strict=True)))
        for name, values in distances(walk).items()
    }
    return xr.Dataset(lost | off | told)
