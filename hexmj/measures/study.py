"""Studies of physical walks from the same starts: their common settings, and the function of their cells."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.conditions import Conditions
from hexmj.controllers.planning import begin
from hexmj.controllers.wrappers import FromSteadyState
from hexmj.measures.tables import WalkSettings, over_start
from hexmj.progress import Progress
from hexmj.starts import check_draw, draw_starts
from hexmj.timing import Stride

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.physics.settle import Settled

UNITS = {
    **dict.fromkeys(("planned_loss", "dynamic_loss", "grounded_loss", "carried_loss", "fall"), "time unit"),
    **dict.fromkeys(("clearance", "tracking", "depth"), "mm"),
    **{"tilt": "rad", "slip": "mm/s"},
}
"""Field of `Outcomes` -> its unit; the other fields are plain numbers."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Settings that all studies share; every cell of a study walks from the same starts."""

    n_starts: int = 100
    """Number of random starts, the same in every cell."""
    seed: int = 0
    """Seed of the random starts."""
    conditions: Conditions = Conditions()
    stride: Stride = Stride()

    def __post_init__(self) -> None:
        check_draw(self.n_starts, self.seed)


@lru_cache(maxsize=16)
def settled_starts(n_starts: int, seed: int, conditions: Conditions, stride: Stride, threads: int | None) -> "Settled":
    """Return the random starts of a seed after they have come to rest; cached, since controllers share them."""
    from hexmj.physics.settle import settle

    return settle(draw_starts(n_starts, seed, stride), conditions, stride, threads)


def outcome_table(
    walks: WalkSettings,
    which: np.ndarray | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> "xr.Dataset":
    """Return every field of `Outcomes`, (start,), of the physical walks with these settings.

    `which` are the indices of the starts that walk, (n,), by default all.
    """
    from hexmj.measures.physical import physical_outcomes
    from hexmj.physics.settle import settle, settle_plan

    starts = walks.starts if which is None else walks.starts[which]
    if isinstance(walks.controller, FromSteadyState):
        plan = begin(walks.controller, starts, walks.velocity, walks.stride, threads=threads)
        settled = settle_plan(plan, walks.conditions, threads)
    elif which is not None:
        settled = settle(starts, walks.conditions, walks.stride, threads)
    else:
        settled = settled_starts(walks.n_starts, walks.seed, walks.conditions, walks.stride, threads)
    how: Any = {"starts": starts, "acceleration": walks.acceleration, "threads": threads, "progress": progress}
    outcomes = physical_outcomes(settled, walks.controller, walks.velocity, walks.duration, **how)
    return over_start(vars(outcomes), UNITS)
