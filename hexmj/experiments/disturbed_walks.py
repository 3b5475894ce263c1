"""Disturbed walks on paper and in physics: what a halt, a stopped leg or a push does, and what three strategies buy.

At every velocity the same starts meet the same disturbances at the same times, whatever the strategy.  They are the
seed's first starts whose plan is stable until then.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from hexmj.cells import kept
from hexmj.errors import InputError
from hexmj.experiments.disturbance import Kind, Walkers, disturbance, draw_walkers
from hexmj.experiments.disturbed_frequencies import with_frequencies
from hexmj.experiments.disturbed_plan import DisturbedPlan
from hexmj.experiments.strategies import Postures, collect_postures
from hexmj.loss_frequency import checked_list, observation_time, settings
from hexmj.network import steps_within
from hexmj.parameters import Acceleration, Model, Network
from hexmj.physics.body import Body
from hexmj.physics.drive import Push
from hexmj.physics.insect import MASS
from hexmj.physics.joint_targets import STRETCH
from hexmj.physics.physical_walks import outcomes_of_plan
from hexmj.physics.settling import settle
from hexmj.plans import Plan
from hexmj.progress import Progress
from hexmj.stability import loss_time

if TYPE_CHECKING:
    import xarray as xr

Strategy = Literal["none", "reorganise", "slow_down", "grasp"]
"""Answers to a disturbance (Section 6): none; legs to the nearest posture of undisturbed walking; a superior level
that lowers the velocity; feet that hold on to the ground, throughout the walk."""

PHYSICAL = ("push", "grasp")
"""Disturbances and strategies of which a plan knows nothing."""

RECOVERY = Acceleration(rate=0.002)
"""After slowing down.  After a halt at V = 0.5 and 0.7, LDVS loses stability on paper in 0.34 and 0.66 of the starts;
0.00 and 0.02 with the paper's a = 0.00008, which takes 5000 and 7500 time units; 0.01 and 0.03 with 0.0004, 0.04 and
0.10 with 0.002, 0.11 and 0.32 with 0.004, 0.30 and 0.64 with 0.01 (400 starts, window `whole`)."""

MOST_IMPULSE = 1000.0
"""Largest impulse in multiples of m V_p; far beyond any that leaves the insect on its feet."""

CHUNK = 200
"""Steps of a plan held in memory while its losses are looked for."""

TIMES = {
    "time": "time of the disturbance",
    "back": "time from which the walk is at its velocity again",
    "planned_loss": "first loss of static stability of the plan, or inf",
    "fall": "first contact of the trunk with the ground, or inf",
}
"""What is kept of every start, all in time units of the network."""


@dataclass(frozen=True)
class Case:
    """A disturbance and the strategy against it."""

    kind: Kind
    strategy: Strategy
    impulse: float = 0.0
    """Of a push, to the left, in multiples of the insect's mass times V_p; a push of 0 is no disturbance."""

    @property
    def disturbance(self) -> str:
        """Its name: undisturbed, halt, leg, push 20."""
        return self.kind if self.kind != "push" else f"push {self.impulse:g}" if self.impulse else "undisturbed"


def cases(
    disturbances: Sequence[Kind], impulses: Sequence[float], strategies: Sequence[Strategy], physical: bool
) -> list[Case]:
    """The undisturbed walk, then every disturbance without a strategy and with each.

    Raises:
        InputError: names or impulses that make no sense, or that need physics where there are none.
    """
    for name, values, valid in (
        ("disturbances", disturbances, get_args(Kind)),
        ("strategies", strategies, get_args(Strategy)[1:]),
        ("impulses", impulses, ()),
    ):
        if len(set(values)) < len(values):
            raise InputError(f"{name} = {list(values)}; expected none of them twice")
        if unknown := [value for value in values if valid and value not in valid]:
            raise InputError(f"{name} = {list(values)}; {unknown[0]!r} is none of {', '.join(valid)}")
    if not all(0 < impulse <= MOST_IMPULSE for impulse in impulses):
        raise InputError(f"impulses = {list(impulses)}; expected above 0 and at most {MOST_IMPULSE:g} times m V_p")
    if not disturbances or ("push" in disturbances and not impulses):
        raise InputError("no disturbance was given, or a push without impulses; expected at least one of each")
    if not physical and (needing := [name for name in PHYSICAL if name in (*disturbances, *strategies)]):
        raise InputError(f"{needing[0]!r} without physics; expected others, since a plan knows nothing of it")
    answers: tuple[Strategy, ...] = ("none", *strategies)
    met: list[tuple[Kind, float]] = [
        (kind, one) for kind in disturbances for one in (impulses if kind == "push" else (0.0,))
    ]
    return [Case("push", "none")] + [Case(kind, answer, float(one)) for kind, one in met for answer in answers]


def disturb(
    model: Model,
    folder: Path,
    walked: Sequence[Case],
    *,
    velocities: Sequence[float],
    starts: int = 60,
    window: str | float = "walk",
    seed: int = 0,
    recovery: Acceleration = RECOVERY,
    adhesion: float = 1.0,
    physical: bool = True,
    body: Body | None = None,
    network: Network | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Walk the same starts in every case; what is finished is not walked again.

    Args:
        model: coupling weights.
        folder: keeps one file for each case and velocity.
        walked: the cases, as `cases` gives them.
        velocities: V_r, each 0 < V < 1, and at least V_r(0) of the recovery where a case slows down.
        starts: number of starts that reach their disturbance, the same in every case.
        window: 'walk', 'start' or the observation time itself [time units].
        seed: of starts, times, legs and postures.
        recovery: of the strategy 'slow_down', from its low velocity to V.
        adhesion: `Body.grasp` of the strategy 'grasp'.
        physical: walk in MuJoCo too.
        body: conditions of the physical walks.
        network: the constants that the paper leaves out.
        threads: one per core unless given; the result does not depend on it.
        progress: told the fraction done since it was last called.

    Returns:
        Over (velocity, case, start) the `TIMES`; a case has the coordinates `disturbance` and `strategy`, the first is
        undisturbed.  Over velocity the observation time `duration` [time units] and the number of starts `drawn` to
        find these.  And the frequencies of `disturbed_frequencies.with_frequencies`.

    Raises:
        InputError, SimulationError: see `disturbance.draw_walkers`, `strategies.collect_postures`, `settling.settle`
            and `drive.drive`.
    """
    import xarray as xr

    body, network, v = body or Body(), network or Network(), checked_list(velocities)
    low = recovery.start if any(case.strategy == "slow_down" for case in walked) else 0.0
    if not ((v > 0) & (v >= low)).all():
        raise InputError(f"velocities = {v.tolist()}; expected above 0 and at least V_r(0), {low:g}, if it slows down")
    bodies = {"grasp": replace(body, grasp=adhesion)}
    duration = observation_time(window, v, network)
    steps_within(duration, network)
    grid = max(1, STRETCH // body.substeps(network))
    told = settings({"model": model}, window, starts, seed, network, None, body) | {"grid": grid}

    @cache
    def walkers(velocity: float) -> Walkers:
        return draw_walkers(model, velocity, starts, seed, network, grid)

    @cache
    def postures(velocity: float) -> Postures:
        return collect_postures(model, velocity, seed, network)

    def cell(case: Case, i: int) -> "xr.Dataset":
        velocity, one = v[i].item(), bodies.get(case.strategy, body) if physical else None
        slower = recovery if case.strategy == "slow_down" else None

        def compute() -> "xr.Dataset":
            found, near = walkers(velocity), postures(velocity) if case.strategy == "reorganise" else None
            times = walk_case(case, found, model, velocity, duration[i], near, slower, one, network, threads)
            return xr.Dataset({name: ("start", values) for name, values in times.items()}).assign(drawn=found.drawn)

        whole = told | {"velocity": velocity, "case": asdict(case), "body": one and asdict(one)}
        whole |= {"acceleration": slower and asdict(slower)}
        data = kept(folder, f"{case.disturbance}-{case.strategy}-V-{velocity:g}", whole, compute)
        if progress:
            progress(duration[i] / duration.sum() / len(walked))
        return data.drop_attrs()

    rows = [xr.concat([cell(case, i) for case in walked], "case") for i in range(len(v))]
    data = xr.concat(rows, "velocity").assign_coords(
        velocity=("velocity", v, {"units": "V_p", "long_name": "velocity V_r"}),
        duration=("velocity", duration, {"units": "time unit", "long_name": "observation time t"}),
        disturbance=("case", [case.disturbance for case in walked]),
        strategy=("case", [case.strategy for case in walked]),
    )
    for name, long_name in TIMES.items() if physical else list(TIMES.items())[:3]:
        data[name].attrs = {"units": "time unit", "long_name": long_name}
    data["drawn"] = data.drawn.isel(case=0).assign_attrs(units="1", long_name="starts drawn to find these")
    more = {"recovery": asdict(recovery), "adhesion": adhesion, "physical": physical}
    return with_frequencies(data).assign_attrs(told | more)


def walk_case(
    case: Case,
    walkers: Walkers,
    model: Model,
    velocity: float,
    window: float,
    postures: Postures | None,
    recovery: Acceleration | None,
    body: Body | None,
    network: Network,
    threads: int | None,
) -> dict[str, np.ndarray]:
    """The `TIMES` of every walker in one case, each (start,); no fall without a body.

    Args:
        case: what they meet.
        walkers: the starts.
        model: coupling weights.
        velocity: V_r.
        window: how long they walk once they are at V again [time units].
        postures: of the strategy 'reorganise'.
        recovery: of the strategy 'slow_down'.
        body: conditions of the physical walk, if there is to be one.
        network: constants of the plan.
        threads: one per core unless given.
    """
    met = disturbance(case.kind, walkers, model, velocity, network)
    answer: Any = {"postures": postures, "acceleration": recovery}

    def plan(threads: int | None) -> DisturbedPlan:
        return DisturbedPlan(walkers.starts, model, velocity, met, **answer, network=network, threads=threads)

    ahead = plan(threads)
    ahead.advance(int(met.step.max()) + 1)
    back = ahead.resumed * network.dt + ((velocity - recovery.start) / recovery.rate if recovery else 0.0)
    end, time = float(back.max() + window), met.step * network.dt
    lost = planned_losses(plan(threads), int(end / network.dt))
    times = {"time": time, "back": back, "planned_loss": lost}
    if body is None:
        return times
    push = Push(np.full(len(time), case.impulse * MASS * body.vp), time)
    settled = settle(walkers.starts, body, network, threads)
    outcomes = outcomes_of_plan(settled, plan(1), end, lost, push=push, threads=threads)
    return times | {"fall": outcomes.fall}


def planned_losses(plan: Plan, steps: int) -> np.ndarray:
    """Time of the first loss of static stability of a plan at time 0 [time units], inf where there is none."""
    lost = loss_time(plan.advance(1))
    while plan.done < steps:
        lost = np.minimum(lost, loss_time(plan.advance(min(CHUNK, steps - plan.done))))
    return lost
