"""Real obstacles in physics: how often the insect, which feels nothing, falls once it has reached one.

The same starts walk on flat ground and towards every obstacle, the same way until a foot reaches it.  All are told to
walk so far that the hindmost foot could be one stride beyond the longest obstacle.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np

from hexmj.cells import kept
from hexmj.errors import InputError, check_distinct
from hexmj.intervals import wilson_intervals
from hexmj.loss_frequency import checked_list, draw_starts, settings
from hexmj.parameters import Model, Network
from hexmj.physics.body import Body, Ground
from hexmj.physics.physical_walks import physical_outcomes
from hexmj.physics.settling import settle
from hexmj.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

VARIED = {"ground": "--grounds", "ground_height": "--heights", "grasp": "--grasps"}
"""Conditions of the body that are given as lists, and their options."""

OUTCOMES = {  # units, long_name
    "fall": ("time unit", "first contact of the trunk with the ground, or inf"),
    "fall_part": ("1", "index of the part that touched first, -1 for none"),
    "tilt": ("rad", "greatest tilt of the trunk"),
    "speed": ("1", "distance walked ahead over distance commanded, until the fall"),
}
"""What is kept of every walk, of `measurement.Outcomes`."""


def terrain(
    model: Model,
    folder: Path,
    *,
    velocities: Sequence[float],
    grounds: Sequence[Ground] = ("step", "gap", "hurdle", "rough"),
    heights: Sequence[float] = (2.0, 4.0, 6.0),
    lengths: Sequence[float] = (2.5, 5.0, 10.0),
    grasps: Sequence[float] = (0.0, 1.0),
    starts: int = 30,
    seed: int = 0,
    body: Body | None = None,
    network: Network | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Walk the same starts on flat ground and to every obstacle; what is finished is not walked again.

    Args:
        model: coupling weights.
        folder: keeps one file for each obstacle, grasp and velocity.
        velocities: V_r, each 0 < V < 1.
        grounds: kinds of obstacles, each once; flat ground comes first by itself.
        heights: of steps, hurdles and rough ground [mm], each once.
        lengths: of gaps [mm], each once.
        grasps: as `Body.grasp`, each once.
        starts: number of starts.
        seed: of the starts.
        body: all other conditions.
        network: the constants that the paper leaves out.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Returns:
        Over (obstacle, grasp, velocity), the obstacle 'flat' first: `reached`, the number of starts that did not fall
        until a front foot was told to reach the obstacle, `flss`, the fraction of these that fell, with its 95 %
        Wilson interval `flss_low`, `flss_high`, and `crossed`, the number that never fell and whose hind feet are
        beyond, on rough ground wherever they stand.  Over starts too: `OUTCOMES`, the `distance` walked [mm], and
        `after`, whether the start fell after it had reached the obstacle.

    Raises:
        InputError, SimulationError: see `settling.settle` and `drive.drive`.
    """
    import xarray as xr

    body, network = body or Body(ground_at=80.0), network or Network()
    v = checked_list(velocities)
    if not (v > 0).all():
        raise InputError(f"velocities = {v.tolist()}; expected V > 0, or no obstacle is ever reached")
    worlds = obstacles(body, grounds, heights, lengths)
    check_distinct("grasps", grasps)
    ahead, behind = reach(network)
    end = np.array([_end(world) for world in worlds.values()])
    distance = end.max() + behind + network.aep0 - network.pep0
    told = settings({"model": model}, "distance", starts, seed, network, None) | {"distance": distance}

    def cell(name: str, grasp: float, velocity: float) -> "xr.Dataset":
        one = replace(worlds[name], grasp=grasp)

        def compute() -> "xr.Dataset":
            settled = settle(draw_starts(starts, seed, network), one, network, threads)
            outcomes = physical_outcomes(settled, model, velocity, distance / velocity, threads=threads)
            return xr.Dataset({key: ("start", getattr(outcomes, key)) for key in OUTCOMES})

        whole = told | {"velocity": velocity, "body": asdict(one)}
        data = kept(folder, f"{name}-grasp-{grasp:g}-V-{velocity:g}", whole, compute)
        if progress:
            progress(1 / velocity / (1 / v).sum() / len(worlds) / len(grasps))
        return data.drop_attrs()

    def along(dimension: str, cells: list["xr.Dataset"]) -> "xr.Dataset":
        return xr.concat(cells, dimension)

    data = along(
        "obstacle",
        [
            along("grasp", [along("velocity", [cell(name, g, one) for one in v.tolist()]) for g in grasps])
            for name in worlds
        ],
    ).assign_coords(
        obstacle=list(worlds),
        ground=("obstacle", [world.ground for world in worlds.values()]),
        size=("obstacle", [_size(world) for world in worlds.values()], {"units": "mm"}),
        end=("obstacle", end, {"units": "mm", "long_name": "where the obstacle ends or has been climbed"}),
        grasp=("grasp", list(grasps), {"units": "1", "long_name": "adhesion of a foot over the insect's weight"}),
        velocity=("velocity", v, {"units": "V_p", "long_name": "velocity V_r"}),
    )
    for name, (units, long_name) in OUTCOMES.items():
        data[name].attrs = {"units": units, "long_name": long_name}
    others = {name: value for name, value in asdict(body).items() if name not in VARIED}
    return _with_frequencies(data, distance, body.ground_at - ahead, behind).assign_attrs(told | {"body": others})


def obstacles(
    body: Body, grounds: Sequence[Ground], heights: Sequence[float], lengths: Sequence[float]
) -> dict[str, Body]:
    """The body on flat ground and before each obstacle, by names such as 'step 2 mm'.

    Raises:
        InputError: none, or one twice; a ground, height or length that makes no sense.
    """
    for name, values in {"grounds": grounds, "heights": heights, "lengths": lengths}.items():
        check_distinct(name, values)
    if wrong := [ground for ground in grounds if ground not in get_args(Ground)[1:]]:
        raise InputError(f"grounds = {list(grounds)}; {wrong[0]!r} is none of {', '.join(get_args(Ground)[1:])}")
    worlds = {"flat": body}
    for ground in grounds:
        for size in lengths if ground == "gap" else heights:
            sized = {"ground_length": size} if ground == "gap" else {"ground_height": size}
            worlds[f"{ground} {size:g} mm"] = replace(body, ground=ground, **sized)
    return worlds


def reach(network: Network) -> tuple[float, float]:
    """How far ahead of O a front foot and how far behind it a hind foot may stand [mm]."""
    origin = network.geometry.origin
    return max(origin) + network.aep0, -(min(origin) + network.pep_min)


def _end(world: Body) -> float:
    """Where an obstacle ends, ahead of O at the start [mm]; a step where it has been climbed."""
    return world.ground_at + (world.ground_length if world.ground in ("gap", "hurdle") else 0.0)


def _size(world: Body) -> float:
    """What an obstacle is called by: the length of a gap, the height of anything else [mm]; 0 for flat ground."""
    return {"flat": 0.0, "gap": world.ground_length}.get(world.ground, world.ground_height)


def _with_frequencies(data: "xr.Dataset", distance: float, begin: float, behind: float) -> "xr.Dataset":
    """The FLSS of the starts that did not fall within `begin` commanded [mm], and what else became of them."""
    import xarray as xr

    commanded = np.minimum(data.fall * data.velocity, distance)
    walked = (data.speed * commanded).assign_attrs(units="mm", long_name="distance walked by O")
    upright, reaching = np.isinf(data.fall), commanded > begin
    after = reaching & ~upright
    reached, fell = reaching.sum("start"), after.sum("start")
    low, high = wilson_intervals(fell.values, reached.values)
    crossed = (upright & (walked > data.end + behind)).sum("start")
    unit = {"units": "1"}
    return data.assign(
        distance=walked,
        after=after.assign_attrs(unit, long_name="fell after it had reached the obstacle"),
        reached=reached.assign_attrs(unit, long_name="starts that reached the obstacle"),
        crossed=crossed.assign_attrs(unit, long_name="starts that crossed it without a fall"),
        flss=(fell / xr.where(reached > 0, reached, np.nan)).assign_attrs(unit, long_name="FLSS from there on"),
        flss_low=(fell.dims, low, unit),
        flss_high=(fell.dims, high, unit),
    )
