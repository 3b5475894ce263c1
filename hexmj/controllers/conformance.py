"""Run the interface checks of a controller: `check_controller` for pytest, `findings` for the command line."""

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
"""Default velocities V_r of a trial, which its starts take in turn."""

ACCELERATION = Acceleration(rate=0.005, start=0.1)
"""Acceleration of the accelerating trial: V = 0.3 is reached after 40 time units. If all velocities of the trial are
above `start`, or none is, walks accelerate from the lowest velocity instead."""


@dataclass(frozen=True)
class Finding:
    """The result of one interface check."""

    name: str
    """Name of the check."""
    well: bool
    """Whether the check passed."""
    found: str
    """What was checked, or what is wrong, with values."""
    note: bool = False
    """True for a remark, which always passes."""


def check_controller(
    controller: Controller, stride: Stride | None = None, velocities: Sequence[float] = VELOCITIES
) -> None:
    """Run the interface checks of a controller; this takes a few seconds.

    Args:
        controller: the controller; it must plan with this stride at each velocity, and accelerate to it.
        stride: step range, lines of the tips and time step.
        velocities: 2 to 16 values of V_r as fractions of V_p, 0 <= V < 1 - 0.005 dt. Accelerating walks begin at 0.1,
            or at the lowest velocity if all velocities are above 0.1, or none is.

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
    """Yield the result of each check in order, and finally a remark on how fast standing feet slide.

    If a check of `FIRST` fails, the later checks are left out: they would fail for the same reason.

    Raises:
        InputError: a velocity is out of range.
    """
    check_controller_type(controller)
    v, stride = checked_list(velocities), stride or Stride()
    if not 2 <= len(v) <= N_STARTS:
        raise InputError(f"velocities = {v.tolist()}; expected 2 to {N_STARTS} values, so that walks can accelerate")
    check_reached(v, stride, ACCELERATION)
    trials = [*_trials(controller, v, stride)]
    for name, law in LAWS.items():
        wrong = next(filter(None, (_failure(law, trial) for trial in trials)), None)
        if wrong and name in FIRST:
            yield Finding(name, False, f"{wrong}; the later checks were left out")
            return
        yield Finding(name, wrong is None, wrong or law.__doc__ or "")
    yield _sliding(trials)


def _trials(controller: Controller, velocities: np.ndarray, stride: Stride) -> Iterator[Trial]:
    """Yield a trial with constant and a trial with accelerating V_r, both with drawn starts and two extreme starts."""
    starts, velocity = draw_starts(N_STARTS, 0, stride), np.resize(velocities, N_STARTS)
    starts[-1], starts[N_STARTS // 2 - 1] = stride.pep0, stride.aep0
    yield Trial(controller, starts, velocity, stride, None)
    least, between = velocities.min(), velocities.min() <= ACCELERATION.start < velocities.max()
    slowly = ACCELERATION if between else replace(ACCELERATION, start=least)
    yield Trial(controller, starts, np.maximum(velocity, slowly.start), stride, slowly)


def _failure(law: Callable[[Trial], None], trial: Trial) -> str | None:
    """Run a check and return its error message on one line, or None if the check passes."""
    try:
        law(trial)
        return None
    except Refused as error:
        found = f"{error}; if the controller cannot plan there, check it at other velocities or time steps"
    except InputError as error:
        found = str(error)
    except Exception as error:  # raised by the controller
        at = traceback.extract_tb(error.__traceback__)[-1]
        found = f"{type(error).__name__} in {at.filename}, line {at.lineno}: {error}"
    return f"{'accelerating: ' if trial.acceleration else ''}{' '.join(found.split())}"


def _sliding(trials: list[Trial]) -> Finding:
    """Describe how fast standing feet slide: the tip of a foot that stays in place on the ground recedes at V_r."""
    slides = []
    for walk, dt in ((trial.walk, trial.stride.dt) for trial in trials):
        ahead, aside = np.diff(walk.x, axis=0) / dt + walk.velocity[1:, :, None], np.diff(walk.y, axis=0) / dt
        speed = np.hypot(ahead, aside) * (walk.stance[1:] & walk.stance[:-1])
        step, *others = np.argwhere(speed == speed.max())[0]
        slides.append((speed.max(), place(walk, (step + 1, *others))))
    most, where = max(slides)
    if most <= 1e-6:
        return Finding("sliding", True, "standing feet stay in place on the ground: their tips recede at V_r")
    found = (
        "standing feet would slide: the tip of a foot that stays in place recedes at V_r, but a tip differs from it by"
        f" {most:.2g} V_p, in {where}; in physical walks such feet scrape over the ground"
    )
    return Finding("sliding", True, found, note=True)
