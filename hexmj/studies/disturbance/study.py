"""Disturbed walks on paper and in physics: what a halt, a stopped leg or a push does, and what three strategies buy.

At every velocity the same starts meet the same disturbances at the same times, whatever the strategy.  They are the
seed's first starts whose plan is stable until then.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from hexmj.controllers.checked_plans import check_velocities
from hexmj.errors import InputError
from hexmj.io import settings
from hexmj.measures.velocities import observed, velocity_axis
from hexmj.physics.pushes import steps_pushed
from hexmj.starts import checked_list
from hexmj.studies.disturbance.cases import Answer, Case, Kind, every_case
from hexmj.studies.disturbance.disturbances import GRID
from hexmj.studies.disturbance.frequencies import with_flss_after
from hexmj.studies.same_starts import SameStarts
from hexmj.sweep import Cell, over_axes
from hexmj.timing import MOST_STEPS, Acceleration, check_reached, steps_within

if TYPE_CHECKING:
    import xarray as xr

RECOVERY = Acceleration(rate=0.002)
"""After slowing down.  The slower, the fewer walks lose stability, but the paper's a = 0.00008 takes thousands of time
units; `docs/laboratory.md` tells what was tried."""


@dataclass(frozen=True)
class DisturbedWalks(SameStarts):
    """The same starts in every case, an undisturbed one among them, at every velocity.

    The controller is a `SteerableController`, or `SensoryFeedback` around one; `observation_time` is that of `frequencies.OBSERVATION_TIMES`.
    """

    velocities: Sequence[float] = (0.3, 0.5, 0.7)
    """V_r, each 0 < V < 1, and at least V_r(0) of the recovery where a case slows down."""
    disturbances: Sequence[Kind] = ("halt", "leg", "push")
    """The body is halted, one protracting leg is stopped, or the body is pushed from the side; each once."""
    impulses: Sequence[float] = (40.0, 60.0)
    """Of the pushes, in multiples of the insect's mass times V_p, each once."""
    strategies: Sequence[Answer] = ("reorganise", "slow_down", "grasp")
    """Beside none, each once."""
    recovery: Acceleration = RECOVERY
    """Of the strategy 'slow_down', from its low velocity to V."""
    adhesion: float = 1.0
    """As `Conditions.grasp`, of the strategy 'grasp'."""
    physical: bool = True
    """Walk in MuJoCo too."""
    n_starts: int = field(default=40, kw_only=True)
    """Number of starts that reach their disturbance, the same in every case."""
    acceleration: None = field(default=None, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        v, slows = checked_list(self.velocities), "slow_down" in self.strategies
        low = self.recovery.start if slows else 0.0
        if not ((v > 0) & (v >= low)).all():
            least = f" and at least V_r(0), {low:g}, to which it slows down" if slows else ""
            raise InputError(f"velocities = {v.tolist()}; expected above 0{least}")
        check_reached(v, self.stride, self.recovery if slows else None)
        observation_time, dt = self.observed[1], self.stride.dt
        if slows and (longest := float((observation_time + self.recovery.duration(v)).max())) > MOST_STEPS * dt:
            raise InputError(
                f"recovery: V and the observation time after it take {longest:g} time units; expected at most {MOST_STEPS * dt:g}"
            )
        if self.physical and "push" in self.disturbances:
            lasts = steps_pushed(self.conditions, self.stride)
            if (steps_within(observation_time, self.stride) < lasts).any():
                raise InputError(
                    f"observation time = {self.observation_time!r}, {observation_time.min():g} time units; expected at least {lasts * dt:g}, which a"
                    " push lasts"
                )
        replace(self.conditions, grasp=self.adhesion)
        if "grasp" in self.strategies and (grasp := self.conditions.grasp):
            raise InputError(f"grasp = {grasp:g}; expected 0, since the strategy 'grasp' has its own, adhesion")
        _ = self._cells()

    @property
    def cases(self) -> list[Case]:
        """The undisturbed walk, then every disturbance without a strategy and with each."""
        return every_case(self.disturbances, self.impulses, self.strategies, self.physical)

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        return observed(self.velocities, self.observation_time, self.stride)

    def cells(self) -> list[Cell]:
        """A cell for each velocity and case; see `sweep.Study`."""
        from hexmj.physics.settling import check_adhesion

        check_velocities(self.controller, self.velocities, self.stride)
        if self.physical and "grasp" in self.strategies:
            check_adhesion(replace(self.conditions, grasp=self.adhesion), self.stride, self.seed)
        return self._cells()

    def _cells(self) -> list[Cell]:
        from hexmj.studies.disturbance.stable_walks import StableWalks

        def walks(velocity: float) -> StableWalks:
            return StableWalks(self.controller, velocity, self.n_starts, self.seed, self.stride, GRID)

        def cell(walks: StableWalks, case: Case, observation_time: float) -> Cell:
            grasping = replace(self.conditions, grasp=self.adhesion) if case.strategy == "grasp" else self.conditions
            settings = {
                "case": case,
                "observation_time": observation_time,
                "recovery": self.recovery if case.strategy == "slow_down" else None,
                "conditions": grasping if self.physical else None,
            }
            name = f"{case.disturbance}-{case.strategy}-V-{walks.velocity:g}"
            return Cell(name, walks.times, settings, work=observation_time)

        at = [(walks(v), time) for v, time in zip(*self.observed, strict=True)]
        return [cell(one, case, time) for one, time in at for case in self.cases]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """When what happened, and how often.

        Returns:
            Over (velocity, case, start) the `stable_walks.TIMES`; a case has the coordinates `disturbance` and
            `strategy`, the first is undisturbed.  Over velocity the observation time `duration` [time units] and the
            number of starts `drawn` to find these.  And the frequencies of `frequencies.with_flss_after`.
        """
        table = over_axes({"velocity": len(self.velocities), "case": len(self.cases)}, data).assign_coords(
            **velocity_axis(*self.observed),
            disturbance=("case", [case.disturbance for case in self.cases]),
            strategy=("case", [case.strategy for case in self.cases]),
        )
        drawn = table.drawn.isel(case=0).assign_attrs(units="1", long_name="starts drawn to find these")
        own = {"recovery": asdict(self.recovery), "adhesion": self.adhesion, "physical": self.physical}
        return self.labelled(with_flss_after(table.assign(drawn=drawn)), "disturb", grid=GRID, **own)


def strategies_in_words(result: "xr.Dataset") -> str:
    """How the strategies of `DisturbedWalks` slow down, to V_r as a fraction of V_p and then with an acceleration per
    time unit, and grasp, in multiples of the insect's weight; as far as there are such, and the result's settings,
    which joining may drop, tell of them.

    Raises:
        InputError: it is no dataset.
    """
    told, words = settings(result), []
    if "slow_down" in result.strategy.values and "recovery" in told:
        words.append("slow down to V = {start:g}, then a = {rate:g}".format(**told["recovery"]))
    if "grasp" in result.strategy.values and "adhesion" in told:
        words.append(f"grasp {told['adhesion']:g}")
    return "; ".join(words)
