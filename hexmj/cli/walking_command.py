"""What commands that walk have in common: the options of the walks, and the line that tells them."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np
from tyro.conf import OmitArgPrefixes

from hexmj.checks import numbers
from hexmj.cli.loaded import seeds_of_searches
from hexmj.cli.options import Accelerating, Controlled, Walks
from hexmj.cli.registry import changed
from hexmj.conditions import Conditions, unusual
from hexmj.controllers.protocol import Controller, FeedbackPlan
from hexmj.errors import InputError
from hexmj.legs import GEOMETRIES
from hexmj.timing import Stride, observation_duration

TOLD = ("vp", "step_height", "standing_height", "lift_time", "landing_time", "friction", "contact_gap")
"""Conditions that stand beside every physical measure; the others only if they are not the usual ones."""


@dataclass(frozen=True)
class WalkingCommand:
    """Base of the commands that walk."""

    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    walks: OmitArgPrefixes[Walks] = field(default_factory=Walks)
    accelerating: OmitArgPrefixes[Accelerating] = field(default_factory=Accelerating)
    controlled: OmitArgPrefixes[Controlled] = field(default_factory=Controlled)
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)

    @property
    def walked(self) -> dict[str, Any]:
        """How walks go, as measures and studies are told: observation time, seed, stride and acceleration."""
        return {
            "observation_time": self.walks.time,
            "seed": self.walks.seed,
            "stride": self.walks.stride,
            "acceleration": self.accelerating.procedure,
        }

    @property
    def steady(self) -> dict[str, Any]:
        """How walks go that do not accelerate, as studies are told: seed, conditions and stride."""
        return {"seed": self.walks.seed, "conditions": self.conditions, "stride": self.walks.stride}

    @property
    def names(self) -> Sequence[str]:
        """Of the controllers that walk, as they were asked for."""
        own = vars(self)
        return own.get("models", [own["model"]] if "model" in own else [])

    @property
    def commanded(self) -> Sequence[float] | float:
        """V_r at which is walked, as far as that is asked for."""
        own = vars(self)
        return own["velocities"] if own.get("velocities") is not None else own.get("velocity", [])

    @property
    def searched(self) -> dict[str, list[int]]:
        """What walks on starts on which a search has found it, each with the seeds of its searches."""
        return {what: seeds for what, seeds in self._searches.items() if self.walks.seed in seeds}

    @property
    def _searches(self) -> dict[str, list[int]]:
        return {what: seeds for name in self.names for what, seeds in seeds_of_searches(name).items()}

    def conditions_line(self, physical: bool = True, varied: Collection[str] = (), walked: float | None = None) -> str:
        """What stands beside every measure: conditions, of physical walks only, but for those that were `varied`; walks
        come as far as the options tell, or as was `walked` at most [mm]."""
        line = f"observation time {self.walks.observation_time} (t in time units); seed {self.walks.seed}"
        if known := self.searched:
            tried = {seed for seeds in self._searches.values() for seed in seeds}
            other = next(seed for seed in count(1998) if seed not in tried)
            line += f", on whose starts a search found {', '.join(known)} (others: --seed {other})"
        stride = self.walks.stride
        told = vars(stride) | {"geometry": {one: name for name, one in GEOMETRIES.items()}[stride.geometry]}
        line += "".join(f"; {name} {told[name]}" for name in changed(stride, Stride()))
        if acceleration := self.accelerating.procedure:
            line += f"; a = {acceleration.rate:g} from V = {acceleration.start:g}"
        line += "".join(f"; {rule} {getattr(self.controlled, rule)}" for rule in self.controlled.rules)
        line += "".join(f"; {name}: {told}" for name in self.names if (told := self.controlled.brought(name)))
        line += "; feedback" if self.controlled.feedback else ""
        if physical:
            values = self.conditions.values()
            told = {*TOLD, *unusual(values)} - {*varied}
            shown = (key for key in values if key in told)
            line += "; " + ", ".join(f"{key} {values[key]}" for key in shown)
            line += "" if "ground_at" in varied else self._ahead(walked)
        return line

    def _ahead(self, walked: float | None) -> str:
        """That no foot gets to what lies ahead, where even the farthest walk is too short, or some get past bumps."""
        from hexmj.bodies.ground import end_of_bumps
        from hexmj.measures.tables import reach

        conditions = self.conditions
        if conditions.ground == "flat":
            return ""
        farthest = self.farthest() if walked is None else walked
        foremost = farthest + reach(self.walks.stride)[0]
        if not foremost > conditions.ground_at:
            return f"; nobody gets to what lies ahead: {farthest:g} mm are walked at most"
        if conditions.ground == "rough" and foremost > (end := end_of_bumps(conditions)):
            return f"; the bumps end {end:g} mm ahead, and the plane follows"
        return ""

    def farthest(self) -> float:
        """How far is walked at most [mm], infinitely where nobody knows."""
        velocities = numbers("velocities", self.commanded)
        if not velocities.size:
            return math.inf
        acceleration = self.accelerating.procedure
        time = observation_duration(self.walks.time, velocities, self.walks.stride, acceleration)
        lag = acceleration.lag(velocities, time) if acceleration else 0.0
        return float((velocities * time - lag).max())

    def refuse_physical(self, reason: str, obeyed: Collection[str] = ()) -> None:
        """Refuse what only a body obeys, where none walks for a reason such as 'without --physical'; what is `obeyed`
        nevertheless may be given.

        Raises:
            InputError: a condition that is not the usual one, or feedback.
        """
        given = [name for name in changed(self.conditions, Conditions()) if name not in obeyed]
        given += ["feedback"] if self.controlled.feedback else []
        if given:
            name = given[0].replace("_", "-")
            raise InputError(f"--{name} {reason}; expected it only where the insect walks in physics")

    def refuse_contact_gap(self, *controllers: Controller) -> None:
        """Refuse a contact gap where no polygon is measured and no plan of the controllers reads it.

        Raises:
            InputError: it is not the usual one.
        """
        from hexmj.controllers.checked_plans import begin
        from hexmj.starts import checked_list, draw_starts

        gap, stride = self.conditions.contact_gap, self.walks.stride
        if gap != Conditions.contact_gap:
            starts, acceleration = draw_starts(1, self.walks.seed, stride), self.accelerating.procedure
            v = checked_list(np.unique(numbers("velocities", self.commanded)).tolist())[:1]
            plans = (begin(one, starts, v, stride, acceleration, threads=1) for one in controllers)
            if not any(isinstance(plan, FeedbackPlan) for plan in plans):
                raise InputError(
                    f"--contact-gap = {gap:g} with falls only; expected it where a polygon is measured (compare, map,"
                    " converge, walk --physical) or the controller reads the legs"
                )
