"""Does a controller keep the laws of `protocol`?  `check_controller` asks, from pytest or the command line.

Every law is one function of a trial, a controller with starts, velocities and a stride; it raises a sentence on the
first thing that is wrong, as `checked_plans` does for all who walk.  On paper nobody knows the legs, so reach is that
of the stride: tips within `REACH` and two steps of its range.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from hexmj.checks import given, short
from hexmj.controllers.checked_plans import Refused, advanced, check_velocities, place, said
from hexmj.controllers.losses import first_losses, planned_losses, tells_losses
from hexmj.controllers.protocol import Controller, check_controller_type, claims_mirrored, is_steerable, settings_of
from hexmj.controllers.reading_law import told
from hexmj.controllers.steering_laws import restarted, seen, slowed
from hexmj.controllers.trial import DIVIDED, N_STARTS, STEPS, Trial, same
from hexmj.errors import InputError
from hexmj.legs import MIRROR
from hexmj.starts import checked_list, draw_starts
from hexmj.timing import Acceleration, Stride, check_reached, commanded_velocities
from hexmj.walks import PLANNED, joined, of_starts

VELOCITIES = (0.0, 0.02, 0.5, 0.95)
"""V_r of the starts of a trial, in turn, unless others are asked for."""

ACCELERATION = Acceleration(rate=0.005, start=0.1)
"""Of a trial that accelerates: V = 0.3 is reached after 40 time units.  It begins with the least V_r that is asked for
where all are above this start, or none is."""

REACH = 0.8
"""How far a tip may be beyond PEP_min or AEP_0 on its own axis [mm], besides two time steps' way at V_p: legs overshoot
both by a step, and one that is raised out there swings for another."""

BESIDE = 0.5
"""How far a tip may be from its leg's line, as a part of the line's distance from the body axis."""


@dataclass(frozen=True)
class Finding:
    """What one law has found."""

    name: str
    """Of the law."""
    well: bool
    """Whether it is kept."""
    found: str
    """One sentence: what is wrong, with values, or what was looked at."""
    note: bool = False
    """Whether it is only told, and no law."""


def check_controller(
    controller: object, stride: Stride | None = None, velocities: Sequence[float] = VELOCITIES
) -> None:
    """Hold a controller to the laws of its protocol; takes a second or a few.

    It has to plan with the stride, and at each of the velocities V_r, 0 <= V < 1, fractions of V_p, and to accelerate
    to them from 0.1, or from the least of them where all are above that, or none is; V and a step of that acceleration,
    0.005 dt, are below 1 together.

    Raises:
        InputError: no controller, or velocities that make no sense.
        AssertionError: a law that is not kept, in one sentence.
    """
    for finding in findings(controller, stride, velocities):
        if not finding.well:
            raise AssertionError(f"{finding.name}: {finding.found}")


def findings(
    controller: object, stride: Stride | None = None, velocities: Sequence[float] = VELOCITIES
) -> Iterator[Finding]:
    """What each law finds of walks with a stride and of each V_r, in order, and at last how far standing feet slide,
    which no law forbids.

    Where a law of `FIRST` is broken, those after it are not tried: they would find the same again.

    Raises:
        InputError: no controller, or velocities that make no sense.
    """
    check_controller_type(controller)
    asked = checked_list(velocities), given("stride", stride, Stride)
    if not 2 <= len(asked[0]) <= N_STARTS:
        told = f"velocities = {short(asked[0].tolist())}; expected 2 to {N_STARTS} of them"
        raise InputError(f"{told}, so that walks accelerate between them")
    check_reached(*asked, ACCELERATION)
    trials = [*_trials(controller, *asked)]  # pyright: ignore[reportArgumentType]
    for name, (law, looked_at) in LAWS.items():
        wrong = next(filter(None, (_wrong(law, trial) for trial in trials)), None)
        if wrong and name in FIRST:
            yield Finding(name, False, f"{wrong}; the laws after this one were not tried")
            return
        yield Finding(name, wrong is None, wrong or looked_at)
    yield Finding("sliding", True, _sliding(trials), note=True)


def _trials(controller: Controller, velocities: np.ndarray, stride: Stride) -> Iterator[Trial]:
    """Starts that are drawn and extreme, at several velocities at once, constant and accelerating."""
    starts, velocity = draw_starts(N_STARTS, 0, stride), np.resize(velocities, N_STARTS)
    starts[-1], starts[N_STARTS // 2 - 1] = stride.pep0, stride.aep0
    yield Trial(controller, starts, velocity, stride, None)
    least, between = velocities.min(), velocities.min() <= ACCELERATION.start < velocities.max()
    slowly = ACCELERATION if between else replace(ACCELERATION, start=least)
    yield Trial(controller, starts, np.maximum(velocity, slowly.start), stride, slowly)


def _wrong(law: Callable[[Trial], None], trial: Trial) -> str | None:
    """What a law finds wrong, in one sentence."""
    try:
        law(trial)
    except InputError as error:
        return f"{'accelerating: ' if trial.acceleration else ''}{error}"


def _settings(trial: Trial) -> None:
    controller: Any = trial.controller
    if not controller.__dataclass_params__.frozen:
        raise InputError(
            "the dataclass is not frozen; expected @dataclass(frozen=True), so that settings stay as they are"
        )
    settings_of(controller)


def _begin(trial: Trial) -> None:
    check_velocities(trial.controller, sorted({*trial.velocity.tolist()}), trial.stride, trial.acceleration)
    try:
        trial.begin()
    except Refused as error:
        raise InputError(f"{error}; if it cannot plan there, ask for other velocities or time steps") from None


def _steps(trial: Trial) -> None:
    starts, velocity, controller = trial.starts.copy(), trial.velocity.copy(), copy(trial.controller)
    stride, acceleration = copy(trial.stride), copy(trial.acceleration)
    with said("begin, without threads"):
        plan = trial.controller.begin(starts, velocity, stride, acceleration)
    advanced(plan, STEPS)
    for name, now, before in (
        ("starts", starts, trial.starts),
        ("velocity", velocity, trial.velocity),
        ("the plan's starts", plan.starts, trial.starts),
    ):
        if not np.array_equal(now, before):
            raise InputError(f"{name} are changed as it goes on; expected the plan to work on a copy")
    told: dict[str, Any] = {
        "stride": (stride, trial.stride),
        "acceleration": (acceleration, trial.acceleration),
        "controller": (trial.controller, controller),
    }
    for name, (now, was) in told.items():
        for one in fields(now) if now else ():
            if getattr(now, one.name) is not getattr(was, one.name):
                raise InputError(f"begin changes {one.name} of the {name}; expected it left alone")


def _times(trial: Trial) -> None:
    time, v = trial.in_parts.time, trial.in_parts.velocity
    expected = np.arange(1, STEPS + 1) * trial.stride.dt
    if not np.array_equal(time, expected):
        raise InputError(
            f"time begins with {time[:3]} and ends at {time[-1]}; expected k dt, {expected[:3]} to {expected[-1]}"
        )
    commanded = commanded_velocities(trial.velocity, 0, STEPS, trial.stride, trial.acceleration)
    if (bad := np.argwhere(v != commanded)).size:
        step, start = bad[0]
        raise InputError(
            f"velocity of step {step}, start {start} is {v[step, start]:.6g}; expected V_r as commanded,"
            f" {commanded[step, start]:.6g} (timing.commanded_velocities)"
        )


def _reach(trial: Trial) -> None:
    stride, walk = trial.stride, trial.walk
    line, span = np.array(stride.geometry.y), stride.aep0 - stride.pep0
    beyond, aside = REACH + 2 * stride.dt, BESIDE * np.abs(line)
    along = stride.pep_min - beyond, stride.aep0 + beyond
    limits = {"x": along, "y": (line - aside, line + aside), "aep": along, "height": (-span / 2, span)}
    for name, (low, high) in limits.items():
        values = getattr(walk, name)
        if (bad := np.argwhere((values < low) | (values > high))).size:
            at = tuple(bad[0])
            low, high = (np.broadcast_to(end, values.shape)[at] for end in (low, high))
            raise InputError(f"{name} is {values[at]:.4g} mm in {place(walk, at)}; expected {low:g} to {high:g} mm")


def _again(trial: Trial) -> None:
    same(trial.walk, advanced(trial.begin(), STEPS), "two plans that are begun alike")
    same(trial.walk, advanced(trial.begin(threads=2), STEPS), "with 1 and 2 threads")


def _divided(trial: Trial) -> None:
    same(trial.walk, trial.in_parts, f"{STEPS} steps at once and in parts of {DIVIDED}")


def _side_by_side(trial: Trial) -> None:
    other = replace(trial, starts=trial.starts[::-1], velocity=trial.velocity[::-1])
    plans = [trial.begin(), other.begin()]
    walks = zip(*([advanced(plan, steps) for plan in plans] for steps in DIVIDED), strict=True)
    for alone, parts in zip((trial.walk, other.walk), walks, strict=True):
        same(alone, joined(parts), "a plan alone, and beside another of the same controller,")


def _batch(trial: Trial) -> None:
    n = len(trial.starts)
    for which in ([0], [n - 2], [1, n - 1, 2], [*range(n)[::-1]], np.arange(3 * n) % n):
        same(of_starts(trial.walk, which), trial.of(which).walk, "a start alone, in another order, or among others")


def _fast_losses(trial: Trial) -> None:
    if tells_losses(plan := trial.begin()):
        steps = STEPS * (len(trial.starts) - np.arange(len(trial.starts))) // len(trial.starts)
        fast, planned = first_losses(plan, steps), planned_losses(trial.begin(), steps)
        if not np.array_equal(fast, planned):
            raise InputError(f"first_losses gives the steps {fast}; expected those of the plan, {planned}")


def _at_speed(trial: Trial) -> None:
    if is_steerable(trial.controller):
        usual = replace(trial, acceleration=None).walk
        same(usual, replace(trial, at_speed=True).walk, "begin without an acceleration, and begin_at_speed,")


def _mirrored(trial: Trial) -> None:
    if claims_mirrored(trial.controller):
        other = replace(trial, starts=trial.starts[:, MIRROR]).walk
        back = replace(other, **{name: getattr(other, name)[..., MIRROR] for name in PLANNED})
        same(trial.walk, replace(back, y=-back.y), "mirrored starts, mirrored back,")


LAWS: dict[str, tuple[Callable[[Trial], None], str]] = {
    "settings": (_settings, "a frozen dataclass with a name, its settings plain data"),
    "begin": (_begin, "plans begin at time 0 of the starts and stride asked for"),
    "steps": (_steps, "finite tips, and stance, aep and height of every step, start and leg; arguments are left alone"),
    "times": (_times, "time is k dt, and velocity is V_r as commanded"),
    "reach": (_reach, "tips lie where legs can reach"),
    "begun again": (_again, "plans begun alike are the same walk, with any threads"),
    "divided": (_divided, "divided anyhow it is the same walk"),
    "side by side": (_side_by_side, "two plans that go on in turn do not feel each other"),
    "batch": (_batch, "a start walks alike alone, in another order and among others"),
    "first losses": (_fast_losses, "first_losses, where plans have it, are those of the plan"),
    "at speed": (_at_speed, "begin_at_speed, where there is one, walks as begin does without an acceleration"),
    "see": (seen, "a plan that can be steered is where its last step says, and goes on from other legs where told"),
    "restart": (restarted, "its starts restart as they begin, and the others do not feel it"),
    "slow down": (slowed, "its starts begin at V_r(0) again when told, and the others do not feel it"),
    "mirrored": (_mirrored, "mirrored starts give mirrored walks, where it claims that"),
    "sense": (told, "a plan that reads the legs feels what it is told of each start, and nothing of others"),
}
"""Every law by its name, and what it has looked at where it is kept."""

FIRST = ("begin", "steps", "begun again", "divided")
"""Laws that all after them rest on."""


def _sliding(trials: list[Trial]) -> str:
    """How far standing tips are from receding at V_r, as tips do whose feet stay where they are on the ground."""
    found, worst = "feet that stand stay where they are on the ground: their tips recede at V_r", 1e-6
    for trial in trials:
        walk, dt = trial.walk, trial.stride.dt
        ahead, aside = np.diff(walk.x, axis=0) / dt + walk.velocity[1:, :, None], np.diff(walk.y, axis=0) / dt
        slides = np.hypot(ahead, aside) * (walk.stance[1:] & walk.stance[:-1])
        if slides.max() > worst:
            worst, (step, start, leg) = slides.max(), np.argwhere(slides == slides.max())[0]
            where = place(walk, (step + 1, start, leg))
            found = (
                "feet that stand would slide: on the ground a standing foot stays where it is while the body walks on,"
                f" so its tip should move straight back at V_r, but one is off by {worst:.2g} V_p, in {where}; on paper"
                " this costs nothing, in physics the feet scrape"
            )
    return found
