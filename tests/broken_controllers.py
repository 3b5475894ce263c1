"""Controllers that each fail one interface check, with the name of the check."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

import hexmj
from hexmj.controllers import Sensed
from hexmj.controllers.baselines.lifted import LiftedPlan
from hexmj.controllers.baselines.metronomes import Metronome
from hexmj.controllers.baselines.righetti import Righetti
from hexmj.legs import CENTRED
from hexmj.timing import AT_SPEED
from hexmj.walks import PlannedWalk
from stepwise_ldvs import Change, Own


def steps_changed(**changed: Callable[[PlannedWalk], Any]) -> Own:
    """A controller that changes every step of LDVS."""
    return Own(lambda walk, _: {name: one(walk) for name, one in changed.items()})


def spoilt(spoil: Callable[..., Any]) -> Any:
    """LDVS with plans that are spoilt, or replaced, as they begin: by plan, starts, velocity and threads."""

    @dataclass(frozen=True)
    class Spoilt(Own):
        def begin(self, starts, velocity, stride, acceleration=None, threads=None):
            plan = Own.begin(self, starts, velocity, stride, acceleration)
            return spoil(plan, starts, velocity, threads) or plan

    return Spoilt()


def walks_changed(change: Callable[[PlannedWalk], dict[str, Any]]) -> Any:
    """A controller whose plans give other walks than they should."""

    def spoil(plan, *_):
        inner = plan.advance
        plan.advance = lambda steps: replace(walk := inner(steps), **change(walk))

    return spoilt(spoil)


COUNT = itertools.count()


@dataclass
class Melting:
    """Not frozen."""

    change: Change | None = None
    name: str = "melting"
    begin = Own.begin


@dataclass(frozen=True)
class Slow(Own):
    """Refuses what it can do."""

    def check_velocity(self, velocity, stride):
        if velocity > 0.5:
            raise hexmj.InputError(f"V = {velocity:g} is too fast")


@dataclass(frozen=True)
class FalselyMirrored(Own):
    """Is not mirrored."""

    mirrored = True


def moved_by_all(plan, *_):
    """All starts move whenever any is sensed."""
    inner, received = plan.advance, []
    plan.advance = lambda steps: replace(walk := inner(steps), x=walk.x - 0.001 * len(received))
    plan.sense = received.append


def moved_by(field: str, mix: Callable[[np.ndarray, Sensed, np.ndarray], None]) -> Any:
    """Tips are moved by what is sensed; `mix` assigns it to starts."""

    def spoil(plan, starts, *_):
        inner, felt = plan.advance, np.zeros(len(starts))
        plan.advance = lambda steps: replace(walk := inner(steps), x=walk.x - 0.001 * felt[:, None])

        def sense(sensed: Sensed) -> None:
            values = getattr(sensed, field)
            mix(felt, sensed, 0.1 * np.sign(1.0 * values).reshape(len(values), -1).mean(axis=1))

        plan.sense = sense

    return spoil


def first_rows(felt: np.ndarray, sensed: Sensed, values: np.ndarray) -> None:
    felt[: len(values)] = values


def their_mean(felt: np.ndarray, sensed: Sensed, values: np.ndarray) -> None:
    felt[sensed.ids] = values.mean()


def right_rows_while_all_walk(felt: np.ndarray, sensed: Sensed, values: np.ndarray) -> None:
    felt[::2] = values if len(values) == len(felt[::2]) else values[:1]


def moved_by_swings(plan, starts, *_):
    """Adds up in the first rows how often a swinging foot has touched."""
    inner, touched, stands = plan.advance, np.zeros(starts.shape), np.ones(starts.shape, dtype=bool)

    def advance(steps: int) -> PlannedWalk:
        walk = inner(steps)
        stands[:] = walk.stance[-1]
        return replace(walk, x=walk.x - 0.001 * touched)

    def sense(sensed: Sensed) -> None:
        touched[: len(sensed.ids)] += sensed.gained & ~stands[sensed.ids]

    plan.advance, plan.sense = advance, sense


def slowed_by_anyone(plan, *_):
    """All starts go slower once any of them tilts."""
    inner, tilts = plan.advance, []
    plan.advance = lambda steps: replace(walk := inner(steps), velocity=walk.velocity * (0.5 if any(tilts) else 1.0))
    plan.sense = lambda sensed: tilts.append((sensed.tilt > 0.05).any())


def one_step_on(plan, *_):
    plan.advance(1)


def one_step_on_with_two_threads(plan, starts, velocity, threads):
    if threads == 2:
        plan.advance(1)
        plan.done = 0


def starts_halved(plan, starts, *_):
    starts *= 0.5


def left_leg_ahead(walk: PlannedWalk, _: int) -> dict[str, Any]:
    return {"x": walk.x[0] + np.array([1e-6, 0.0, 0.0, 0.0, 0.0, 0.0])}


@dataclass(frozen=True)
class OtherAtSpeed:
    """LDVS, but where it is disturbed or steered."""

    name: str = "other at speed"

    def begin(self, *given: Any) -> Any:
        return hexmj.LDVS.begin(*given)

    def begin_at_speed(self, *given: Any) -> Any:
        return hexmj.UNCOORDINATED.begin_at_speed(*given)


def begun_elsewhere(plan: LiftedPlan, which: np.ndarray, tips: np.ndarray) -> None:
    """At the tips, with what the rule would remember at those of its first beginning."""
    LiftedPlan.restart(plan, which, plan.starts)
    plan.see(np.where(which[:, None], tips, plan.tips), plan.standing)


def with_the_first(plan: LiftedPlan, tips: np.ndarray, standing: np.ndarray) -> None:
    """All starts walk as fast as the first one after they were seen."""
    LiftedPlan.see(plan, tips, standing)
    plan.velocity = np.full_like(plan.velocity, plan.velocity[0])


def forgetful(plan: LiftedPlan, which: np.ndarray) -> None:
    """Those that slow down forget what the rule remembered."""
    LiftedPlan.slow_down(plan, which)
    plan._state = type(plan._state)(*(np.where(which[:, None], 0.0, one) for one in plan._state))


def others_forget(plan: LiftedPlan, which: np.ndarray, tips: np.ndarray) -> None:
    """Those that do not restart do."""
    LiftedPlan.restart(plan, which, tips)
    plan._state = type(plan._state)(*(np.where(which[:, None], one, 0.0) for one in plan._state))


def steered(rule: type = Metronome, **changed: Any) -> Any:
    """Return a baseline whose plans do something else when they are steered."""
    plan: Any = type("SteeredPlan", (LiftedPlan,), changed)
    ages = {"begin": 0, "begin_at_speed": AT_SPEED}
    begins = {name: lambda rule, *given, age=age: plan(rule, *given[:4], age) for name, age in ages.items()}
    return type("Steered", (rule,), begins)()


BROKEN: list[tuple[str, Any]] = [
    ("steering", steered(see=lambda *_: None)),
    ("steering", steered(see=lambda plan, tips, _: LiftedPlan.see(plan, tips, plan.standing))),
    ("steering", steered(tips=property(lambda plan: plan.starts[:, :5]))),
    ("steering", steered(tips=property(lambda plan: plan.starts))),
    ("steering", steered(see=with_the_first)),
    ("steering", steered(restart=lambda plan, which, tips: LiftedPlan.restart(plan, np.ones_like(which), tips))),
    ("steering", steered(restart=lambda plan, which, _: LiftedPlan.restart(plan, which, plan.starts))),
    ("steering", steered(Righetti, restart=begun_elsewhere)),
    ("steering", steered(Righetti, restart=others_forget)),
    ("steering", steered(slow_down=lambda *_: None)),
    ("steering", steered(slow_down=lambda plan, which: LiftedPlan.slow_down(plan, np.ones_like(which)))),
    ("steering", steered(slow_down=lambda plan, _: LiftedPlan.see(plan, plan.starts, plan.standing))),
    ("steering", steered(Righetti, slow_down=forgetful)),
    ("at speed", OtherAtSpeed()),
    ("settings", Melting()),
    ("begin", Slow()),
    ("begin", spoilt(lambda *_: 3)),
    ("begin", spoilt(one_step_on)),
    ("begin", spoilt(lambda plan, *_: setattr(plan, "starts", plan.starts + 1e-9))),
    ("begin", spoilt(lambda plan, *_: setattr(plan, "stride", hexmj.Stride(dt=0.2)))),
    ("begin", spoilt(lambda *_: 1 / 0)),
    ("steps", spoilt(starts_halved)),
    ("steps", walks_changed(lambda walk: {"x": walk.x[:, :1]})),
    ("steps", walks_changed(lambda walk: {"geometry": CENTRED})),
    ("steps", steps_changed(x=lambda walk: np.where(walk.stance[0], walk.x[0], np.nan))),
    ("steps", steps_changed(height=lambda walk: np.inf)),
    ("steps", steps_changed(x=lambda walk: np.zeros((2, 2)))),
    ("times", walks_changed(lambda walk: {"time": walk.time * (1 + 1e-12)})),
    ("times", walks_changed(lambda walk: {"velocity": np.full_like(walk.velocity, 0.5)})),
    ("reach", steps_changed(x=lambda walk: walk.x[0] + 5.0)),
    ("reach", steps_changed(y=lambda walk: 1.6 * walk.y[0])),
    ("reach", steps_changed(height=lambda walk: 30.0)),
    ("begun again", steps_changed(x=lambda walk: walk.x[0] + 1e-9 * next(COUNT))),
    ("begun again", spoilt(one_step_on_with_two_threads)),
    ("batch", steps_changed(x=lambda walk: walk.x[0] + 1e-6 * walk.x[0].mean())),
    ("divided", walks_changed(lambda walk: {"x": walk.x + 1e-9 * len(walk.x)})),
    ("mirrored", FalselyMirrored(left_leg_ahead)),
    ("sense", spoilt(moved_by_all)),
    *(
        ("sense", spoilt(moved_by(field.name, first_rows)))
        for field in fields(Sensed)
        if field.name not in ("ids", "tips")
    ),
    ("sense", spoilt(moved_by("tilt", their_mean))),
    ("sense", spoilt(moved_by("tilt", right_rows_while_all_walk))),
    ("sense", spoilt(moved_by_swings)),
    ("sense", spoilt(slowed_by_anyone)),
]
"""Name of the check that fails, and a controller."""
