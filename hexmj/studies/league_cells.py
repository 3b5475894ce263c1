"""Controllers of a league, and their cells: kinematic losses, steady-state gaits, falls and trials."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.controllers.baselines import BASELINES
from hexmj.controllers.planning import begin
from hexmj.controllers.protocol import Controller
from hexmj.controllers.registry import VARIED, known_names, load_controller
from hexmj.gaits import steady_state_gait
from hexmj.measures.kinematic import first_loss
from hexmj.measures.study import UNITS, by_halves, standing_starts
from hexmj.measures.tables import WalkSettings, happened, over_start
from hexmj.phases import CONTRALATERAL, IPSILATERAL, circular_mean
from hexmj.starts import draw_starts
from hexmj.studies.disturbed_walks import Case, StableWalks, TooFewStable
from hexmj.timing import steps_within

if TYPE_CHECKING:
    import xarray as xr

OWN = ("own", "own-0.3", "own-0.5", "robust-0.1", "lasting", "lasting-0.3")
NETWORK = ("uncoordinated", "hws", "ldvs", "ldvs-tripod", *OWN)
"""Weight sets of the 1998 network that take part in the league."""

EVERYONE = (*NETWORK, *BASELINES)
"""Names of all entrants of the league."""

FOUR = ("ldvs", "uncoordinated", "wilson", "graham")
"""Names of the entrants of a quick league."""

EFFORT = {"work": "mm", "torque": "1", "way": "mm"}
"""Column that `EntrantWalks.outcomes` adds to `Outcomes` -> its unit."""

DISTURBED = {"time": "time unit", "fall": "time unit"}
"""Column of `StableWalks.times` that `EntrantWalks.disturbed` uses -> its unit."""


def entrants(names: Sequence[str]) -> dict[str, Controller]:
    """Load controllers and return them by distinct names for tables: hexmj's own names, else the controller's `name`.

    Raises:
        InputError: there is no controller of this name.
    """
    found, known, short = {name: load_controller(name) for name in names}, {*known_names()}, {}
    for name, controller in found.items():
        varied = VARIED.fullmatch(name)
        short[name] = name if (varied["name"] if varied else name) in known else controller.name
    often = Counter(short.values())
    return {name if often[short[name]] > 1 else short[name]: controller for name, controller in found.items()}


@dataclass(frozen=True)
class EntrantWalks(WalkSettings):
    """Walks of one entrant. The methods are functions of cells, and return a dataset over start."""

    def losses(self, threads: int | None = None) -> "xr.Dataset":
        """Return `lost`: 1 for each start that loses static stability in its planned walk, else 0."""
        how: Any = {"stride": self.stride, "acceleration": self.acceleration, "threads": threads}
        time = first_loss(self.starts, self.controller, self.velocity, self.duration, **how)
        return over_start({"lost": np.isfinite(time).astype(np.int8)})

    def gaits(self, periods: int, threads: int | None = None) -> "xr.Dataset":
        """Return the steady-state gait of each start after a number of `periods`, see `gaits.steady_state_gait`.

        Returns:
            `reached`, the time at which the gait begins [time units], inf if there is none; whether it is statically
            `stable`; mean `duty_factor` and mean phases `ipsilateral` and `contralateral`, NaN without a gait.
        """
        how: Any = {"seed": self.seed, "stride": self.stride, "periods": periods, "threads": threads}
        gait = steady_state_gait(self.controller, self.velocity, n_starts=self.n_starts, **how)
        columns = {
            "reached": gait.reached,
            "stable": gait.stable.astype(np.int8),
            "duty_factor": gait.duty_factor.mean(axis=1),
            "ipsilateral": circular_mean(gait.phase[:, IPSILATERAL], axis=1),
            "contralateral": circular_mean(gait.phase[:, CONTRALATERAL], axis=1),
        }
        return over_start(columns, {"reached": "time unit"})

    def outcomes(self, threads: int | None = None) -> "xr.Dataset":
        """Return the outcome of every physical walk.

        Returns:
            All fields of `Outcomes`; `fell`, 1 or 0; the `work` of the joints over the insect's weight [mm] and the
            greatest `torque` over its limit, see `EffortSoFar`; `way`, the distance walked ahead [mm]; and whether the
            walk is `missing` since it failed, see `unless_refused`. All other numbers of such a walk are NaN.

        Raises:
            SimulationError: no random start comes to rest.
        """
        from hexmj.measures.physical import physical_outcomes
        from hexmj.physics.outcomes import EffortSoFar, Outcomes
        from hexmj.physics.settle import settle, settle_plan

        starts, conditions, stride = self.starts, self.conditions, self.stride
        columns = {field.name: UNITS.get(field.name, "1") for field in fields(Outcomes)} | EFFORT

        def walked(which: np.ndarray) -> "xr.Dataset":
            plan = begin(self.controller, starts[which], self.velocity, stride, threads=threads)
            settled = settle_plan(plan, conditions, threads)
            effort = EffortSoFar(settled)
            how: Any = {"starts": starts[which], "threads": threads, "effort": effort}
            outcomes = physical_outcomes(settled, self.controller, self.velocity, self.duration, **how)
            costs = {"work": effort.work / settled.compiled.weight, "torque": effort.torque}
            time = int(steps_within(self.duration, stride)) * stride.dt
            commanded = np.minimum(outcomes.fall, time) * self.velocity
            return over_start(vars(outcomes) | costs | {"way": commanded * outcomes.speed}, columns)

        found = unless_refused(walked, len(starts), columns)
        random = self.n_starts, self.seed
        if found.fall.isnull().all() and not standing_starts(*random, conditions, stride, threads).size:
            settle(draw_starts(*random, stride), conditions, stride, threads)
        return found.assign(fell=happened(found.fall), missing=found.fall.isnull())

    def disturbed(self, case: Case, threads: int | None = None) -> "xr.Dataset":
        """Return `fell`: 1 for starts that fall after the disturbance, 0 for others.

        NaN for a start that falls before the disturbance or whose walk fails, and for all if too few have stable plans.
        """
        stable = StableWalks(self.controller, self.velocity, self.n_starts, self.seed, self.stride)
        how = case, self.duration, None, self.conditions, threads
        try:
            times = unless_refused(lambda which: stable.times(*how, which)[[*DISTURBED]], self.n_starts, DISTURBED)
        except TooFewStable:
            return over_start({"fell": np.full(self.n_starts, np.nan)})
        return times.assign(fell=happened(times.fall).where(~(times.fall <= times.time)))[["fell"]]


def unless_refused(
    walked: Callable[[np.ndarray], "xr.Dataset"], n_starts: int, columns: Mapping[str, str]
) -> "xr.Dataset":
    """Return the outcomes of all starts over start, with NaN for walks that fail.

    A walk fails if its start cannot stand, it diverges, foot targets are out of reach or a push acts at its end.

    Args:
        walked: returns the outcomes of starts, given by index; outcomes of a start must not depend on the other starts.
        n_starts: number of all starts.
        columns: outcome -> its unit, used if all walks fail.
    """
    import xarray as xr

    everyone = np.arange(n_starts)
    parts = [part.assign_coords(start=which) for which, part in by_halves(everyone, walked, diverging=True)]
    if not parts:
        return over_start({name: np.full(n_starts, np.nan) for name in columns}, columns)
    return xr.concat(parts, "start").reindex(start=everyone)
