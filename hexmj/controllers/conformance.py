"""Does a controller keep the interface of `protocol`? `check_controller` asks, from pytest or the command line."""

import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hexmj.controllers.laws import FIRST, LAWS, N_STARTS, Trial
from hexmj.controllers.planning import place
from hexmj.controllers.protocol import Controller, check_controller_type
from hexmj.errors import InputError, Refused
from hexmj.starts import checked_list, draw_starts
from hexmj.timing import Acceleration, Stride, check_reached

VELOCITIES = (0.0, 0.02, 0.5, 0.95)
"""V_r of the starts of a trial, in turn, by default."""

ACCELERATION = Acceleration(rate=0.005, start=0.1)
"""Of the trial that accelerates: V = 0.3 is reached after 40 time units. It begins with the least velocity of the trial
where that is higher than this start, or where none is higher."""


@dataclass(frozen=True)
class Finding:
    """The result of one interface check."""

    name: str
    """Name of the check."""
    well: bool
    """Whether it passed."""
    found: str
    """What is wrong, with values, or what was checked."""
    note: bool = False
    """Whether it is a remark rather than a check."""


def check_controller(
    controller: Controller, stride: Stride | None = None, velocities: Sequence[float] = VELOCITIES
) -> None:
    """Run the interface checks of a controller; this takes a few seconds.

    Args:
        controller: has to plan with the stride at each of the velocities, and to accelerate to them.
        stride: step range, lines of the tips and time step.
        velocities: 2 to 16 values of V_r, 0 <= V < 1, fractions of V_p. Walks accelerate from 0.1, or from the least
            of them where all or none are above that; V and a step of that acceleration, 0.005 dt, are below 1 together.

    Raises:
        InputError: a velocity is out of range.
        AssertionError: a check failed.
    """
    for finding in findings(controller, stride, velocities):
        if not finding.well:
            raise AssertionError(f"{finding.name}: {finding.found}")


def findings(
    controller: Controller, stride: Stride | None = None, velocities: Sequence[float] = VELOCITIES
) -> Iterator[Finding]:
    """Yield the result of each check, in order, and at last how far standing feet slide, which is a remark.

    After a failed check of `FIRST` the later ones are left out: they would find the same again.

    Raises:
        InputError: a velocity is out of range.
    """
    check_controller_type(controller)
    v, stride = checked_list(velocities), stride or Stride()
    if not 2 <= len(v) <= N_STARTS:
        raise InputError(f"velocities = {v.tolist()}; expected 2 to {N_STARTS}, so that walks accelerate between them")
    check_reached(v, stride, ACCELERATION)
    trials = [*_trials(controller, v, stride)]
    for name, law in LAWS.items():
        wrong = next(filter(None, (_failure(law, trial) for trial in trials)), None)
        if wrong and name in FIRST:
            yield Finding(name, False, f"{wrong}; the later checks were left out")
            return
        yield Finding(name, wrong is None, wrong or law.__doc__ or "")
    yield Finding("sliding", True, _sliding(trials), note=True)


def _trials(controller: Controller, velocities: np.ndarray, stride: Stride) -> Iterator[Trial]:
    """Drawn and extreme starts, at several velocities at once, constant and accelerating."""
    starts, velocity = draw_starts(N_STARTS, 0, stride), np.resize(velocities, N_STARTS)
    starts[-1], starts[N_STARTS // 2 - 1] = stride.pep0, stride.aep0
    yield Trial(controller, starts, velocity, stride, None)
    least, between = velocities.min(), velocities.min() <= ACCELERATION.start < velocities.max()
    slowly = ACCELERATION if between else replace(ACCELERATION, start=least)
    yield Trial(controller, starts, np.maximum(velocity, slowly.start), stride, slowly)


def _failure(law: Callable[[Trial], None], trial: Trial) -> str | None:
    """Return what a check finds wrong in one line, or None."""
    try:
        law(trial)
        return None
    except Refused as error:
        found = f"{error}; if the controller cannot plan there, check it at other velocities or time steps"
    except InputError as error:
        found = str(error)
    except Exception as error:  # of the controller
        at = traceback.extract_tb(error.__traceback__)[-1]
        found = f"{type(error).__name__} in {at.filename}, line {at.lineno}: {error}"
    return f"{'accelerating: ' if trial.acceleration else ''}{' '.join(found.split())}"


def _sliding(trials: list[Trial]) -> str:
    """Describe how far standing tips are from receding at V_r, as the tips of feet that stay in place on the ground."""
    slides = []
    for walk, dt in ((trial.walk, trial.stride.dt) for trial in trials):
        ahead, aside = np.diff(walk.x, axis=0) / dt + walk.velocity[1:, :, None], np.diff(walk.y, axis=0) / dt
        speed = np.hypot(ahead, aside) * (walk.stance[1:] & walk.stance[:-1])
        step, *others = np.argwhere(speed == speed.max())[0]
        slides.append((speed.max(), place(walk, (step + 1, *others))))
    most, where = max(slides)
    if most <= 1e-6:
        return "feet that stand stay where they are on the ground: their tips recede at V_r"
    return (
        "feet that stand would slide: the tip of a foot that stays in place recedes at V_r, but one differs by"
        f" {most:.2g} V_p, in {where}; in physical walks such feet scrape"
    )
