"""What is minimised (paper, Section 3): Problem 1, a fixed velocity, and Problem 2, velocities drawn from a range."""

from dataclasses import asdict, dataclass, field, is_dataclass, replace
from typing import Any, Literal

import numpy as np

from hexmj.checks import check_types, numbers, typed
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.feedback import SensoryFeedback
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.plain import plain
from hexmj.search.domain import Domain
from hexmj.search.forms import Form
from hexmj.search.network_forms import NetworkForm
from hexmj.starts import checked_velocities
from hexmj.timing import OBSERVATION_TIMES, Acceleration, Stride, check_in_time, observation_duration, steps_within
from hexmj.variants import variants, varied

FARTHEST = 1e6
"""Greatest reach of a first population."""

MOST = 1e30
"""Greatest magnitude of a parameter with which a search begins."""

Over = Literal["usual", "mean", "worst"]
"""What is minimised: the FLSS as given, or the mean or the greatest FLSS over all variants."""

Ties = Literal["equal", "later"]
"""Of candidates that lose equally many starts none is better, or that which loses them later."""


@dataclass(frozen=True)
class Problem:
    """A cost function G: FLSS of controllers of a form, I_N^t of Eq. 9 or J_N^t of Eq. 10."""

    form: Form
    """Which parameters are free."""
    low: float
    """Least velocity of the range W, a fraction of V_p; Problem 1 where it is also the greatest."""
    high: float
    """Greatest velocity of the range W, a fraction of V_p."""
    observation_time: str | float = "walk"
    """'walk', 'start' or the observation time itself [time units]."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines of the tips and time step."""
    acceleration: Acceleration | None = None
    """The accelerating procedure of Eq. 11."""
    conditions: Conditions | None = None
    """Of physical walks, where the physical FLSS is minimised; without it the kinematic one."""
    feedback: bool = False
    """Candidates read the legs, see `SensoryFeedback`, in physical walks."""
    over: Over = "usual"
    """Constants and rules under which a candidate walks, each time from the same starts."""
    ties: Ties = "equal"
    """What counts among candidates of the same FLSS; 'later' shows a way where all starts lose stability."""

    def __post_init__(self) -> None:
        check_types(self)
        if not (is_dataclass(self.form) and not isinstance(self.form, type) and isinstance(self.form, Form)):
            raise InputError(f"form = {self.form!r:.80}; expected a frozen dataclass such as NetworkForm or FieldsForm")
        if not 0 <= self.low <= self.high < 1:
            raise InputError(f"velocity range {self.low} to {self.high}; expected 0 <= low <= high < 1")
        if self.feedback and not self.conditions:
            raise InputError("feedback without conditions; expected it with physical walks only")
        if self.conditions:
            check_ground(self.conditions)
        if self.over != "usual" and not isinstance(self.form, NetworkForm):
            raise InputError(
                f"over = {self.over!r} with {self.form!r:.80}; expected it with the 1998 network, whose rules vary"
            )
        ends = checked_velocities([self.low, self.high], 2, self.acceleration)
        duration = observation_duration(self.observation_time, ends, self.stride, self.acceleration)
        check_in_time(ends, duration, self.acceleration)
        steps_within(duration, self.stride)
        _ = self.variants

    @property
    def variants(self) -> "dict[str, Problem]":
        """The problems over whose FLSS the mean or the greatest is taken, by the names of the variants."""
        if self.over == "usual":
            return {"usual": self}
        return {
            name: replace(self, form=varied(self.form, name), stride=varied(self.stride, name), over="usual")
            for name in variants(physical=self.conditions is not None)
        }

    @property
    def observation_times(self) -> list[str | float]:
        """The observation time of the cost, and the named ones beside it."""
        named = [name for name in OBSERVATION_TIMES if self.low > 0 or name != "walk"]
        return list(dict.fromkeys([self.observation_time, *named]))

    def domain(self, reach: float, begin: Controller | None = None) -> Domain:
        """Where a search begins, see `Form.box`; at `begin`, if one is given."""
        if not 0 < typed("domain", reach, float) <= FARTHEST:
            raise InputError(f"domain = {reach}; expected above 0 and at most {FARTHEST:g}")
        form, size = self.form, len(self.form.names)
        box = numbers("box of the form", form.box(reach))
        where = form.begin if begin is None else form.vector(begin)
        where = None if where is None else numbers("begin of the form", where)
        if box.shape != (2, size):
            raise InputError(f"the form's box is {box}; expected a least and a greatest value of its {size} parameters")
        if (odd := np.flatnonzero(~((np.abs(box) <= MOST).all(axis=0) & (box[0] < box[1])))).size:
            told = f"the form's box of {form.names[odd[0]]} is {box[0, odd[0]]:g} to {box[1, odd[0]]:g}"
            raise InputError(f"{told}; expected a least and a greatest value, each within {MOST:g} of 0")
        if where is not None and (where.shape != (size,) or not (np.abs(where) <= MOST).all()):
            raise InputError(f"a search begins at {where}; expected {size} finite numbers")
        typed("binary of the form", form.binary, np.ndarray)
        if form.binary.shape != (size,) or form.binary.dtype != bool:
            raise InputError(f"the form's binary = {form.binary!r:.80}; expected True or False for {size} parameters")
        unit = np.abs(numbers("box of the form", form.box(1.0))).max(axis=0)
        return Domain(box[0], box[1], form.binary, where, unit)

    def controller(self, vector: np.ndarray) -> Controller:
        """A candidate, from (parameter,)."""
        planning = self.form.controller(vector)
        return SensoryFeedback(planning) if self.feedback else planning

    @property
    def minimised(self) -> str:
        """What a cost is, in words: a frequency only where ties are none."""
        if self.ties == "equal":
            cost = "FLSS"
        else:
            cost = f"(starts {'that fell' if self.conditions else 'lost'} + mean part of the time lost) / (starts + 1)"
        return {"usual": cost, "mean": f"mean over variants of {cost}", "worst": f"greatest {cost} of all variants"}[
            self.over
        ]

    def refusal(self, vector: np.ndarray) -> str:
        """Why its controller refuses a candidate, (parameter,); nothing where it does not."""
        try:
            self.controller(vector)
        except (InputError, ValueError) as error:
            return f"{type(error).__name__}: {error}"
        return ""

    def settings(self) -> dict[str, Any]:
        """The problem as plain data."""
        names = "form", "low", "high", "observation_time", "feedback", "over", "ties"
        told = {name: plain(getattr(self, name)) for name in names}
        told |= {"stride": asdict(self.stride), "acceleration": self.acceleration and asdict(self.acceleration)}
        return told | {"conditions": self.conditions and self.conditions.settings()}
