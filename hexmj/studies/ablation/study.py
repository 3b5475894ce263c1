"""Controllers without one mechanism or rule, or with one more, beside the whole, on the same starts."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.checks import check_types, typed, whole
from hexmj.conditions import Conditions, check_ground
from hexmj.controllers.checked_plans import check_velocities
from hexmj.controllers.named import load_controller
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.gaits import CYCLES
from hexmj.io import attributes
from hexmj.measures.captions import not_printed
from hexmj.measures.velocities import observed, velocity_axis
from hexmj.plain import plain
from hexmj.studies.frequencies import came, differences, frequencies, padded
from hexmj.studies.league import on_paper
from hexmj.studies.league.entrant import Entrant
from hexmj.studies.league.study import FRESH, PERIODS, REGIMES, check_counts
from hexmj.studies.short_names import short_names
from hexmj.sweep import Cell
from hexmj.timing import Stride

if TYPE_CHECKING:
    import xarray as xr

SWITCHES = (*(f"without-{part}" for part in (1, 2, 3, 4, 5)), "with-2", "with-4")
"""What may be done to a controller, as `load_controller` names it."""

MEASURES = {
    "start": "lost on paper within two protractions",
    "walk": "lost on paper within three periods",
    "limit": "lost static stability in the limit",
    "physical": "fell within three periods",
}
"""What is counted."""


def wholes(names: Sequence[str]) -> dict[str, dict[str, Controller]]:
    """What comes of each controller, see `switched`, by short names, see `short_names`.

    Raises:
        InputError: no such controller, or one of which nothing can be switched.
    """
    short = short_names({name: load_controller(name) for name in names})
    return {short[name]: switched(name, short[name]) for name in names}


def switched(name: str, shown: str = "") -> dict[str, Controller]:
    """The whole controller, and what comes of it by each of the `SWITCHES` that make a difference, by their names.

    Args:
        name: of the whole, as `load_controller` takes it.
        shown: what it is called instead.

    Raises:
        InputError: no such controller, or one of which nothing can be switched.
    """
    shown = shown or name
    found = {shown: load_controller(name)}
    for switch in SWITCHES:
        try:
            found[f"{shown}-{switch}"] = load_controller(f"{name}-{switch}")
        except InputError as error:
            if error.__cause__:
                raise  # what a user's code raised
    if len(found) == 1:
        raise InputError(
            f"{name} has no mechanisms or rules that can be switched; expected a set of the network, or Walknet"
        )
    return found


@dataclass(frozen=True)
class Ablation:
    """The same starts for every controller; all of them on paper, the first of them in physics."""

    models: Mapping[str, Mapping[str, Controller]]
    """Of each whole what comes of it, the whole first, as `switched` gives them."""
    velocities: Sequence[float] = (0.1, 0.3, 0.5, 0.7)
    """V_r, each 0 < V < 1."""
    n_starts: int = 1000
    """Number of starts on paper."""
    n_physical: int = 100
    """Of these, number of starts in physics."""
    periods: int = PERIODS
    """Cycles that every leg has time for until its limit regime is looked at."""
    seed: int = FRESH
    """Of the starts."""
    conditions: Conditions = field(default_factory=Conditions)
    """Of physical walks."""
    stride: Stride = field(default_factory=Stride)
    """Step range, lines of the tips and time step."""

    def __post_init__(self) -> None:
        check_types(self)
        check_ground(self.conditions)
        check_counts(self, "n_physical")
        whole("periods", self.periods, CYCLES + 2)
        if not self.models:
            raise InputError("no controller was given; expected at least one")
        for name, several in self.models.items():
            if name not in typed(f"models[{name!r}]", several, Mapping):
                raise InputError(f"models[{name!r}] = {[*several]}; expected {name} itself among them")
        names = [name for several in self.models.values() for name in several]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise InputError(
                f"models = {list(self.models)}; {twice[0]} stands twice, alone and as a part of what comes of another;"
                " expected each controller once"
            )
        if not (self.observed[0] > 0).all():
            raise InputError(f"velocities = {self.velocities}; expected each above 0")

    @property
    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities and observation times [time units], both (velocity,)."""
        return observed(self.velocities, "walk", self.stride)

    @property
    def controllers(self) -> dict[str, Controller]:
        """All of them."""
        return {name: one for several in self.models.values() for name, one in several.items()}

    def cells(self) -> list[Cell]:
        """Every controller, velocity and measure; see `sweep.Study`."""
        from hexmj.physics.settling import check_adhesion
        from hexmj.studies.league import in_physics

        def cell(name: str, measure: str, velocity: float, time: float) -> Cell:
            controller = self.controllers[name]
            told: dict[str, Any] = {"entrant": Entrant(controller), "velocity": velocity, "seed": self.seed}
            told |= {"stride": self.stride, "n_starts": self.n_starts}
            if measure in ("start", "walk"):
                return Cell(
                    f"{name}-{measure}-V-{velocity:g}", on_paper.losses, told | {"observation_time": measure}, time
                )
            if measure == "limit":
                few = {"n_starts": min(self.n_starts, REGIMES), "periods": self.periods}
                return Cell(f"{name}-limit-V-{velocity:g}", on_paper.regimes, told | few, 10 * time)
            own = {"controller": controller, "observation_time": "walk", "conditions": self.conditions}
            walked = told | own | {"n_starts": self.n_physical}
            return Cell(f"{name}-physical-V-{velocity:g}", in_physics.walks, walked, 20 * time)

        for one in self.controllers.values():
            check_velocities(one, self.velocities, self.stride)
        check_adhesion(self.conditions, self.stride, self.seed)
        at = [(float(v), float(time)) for v, time in zip(*self.observed, strict=True)]
        return [cell(name, measure, *one) for name in self.controllers for measure in MEASURES for one in at]

    def result(self, data: Sequence["xr.Dataset"]) -> "xr.Dataset":
        """How often it happened, and how much more often than to the whole.

        Returns:
            Over (controller, measure, velocity): `frequency` with its 95 % Wilson interval `_low`, `_high`, of so many
            `_starts`; and how far it is above that of the `whole` on the same starts, `more`, with its interval.
        """
        import xarray as xr

        names, (velocities, _) = list(self.controllers), self.observed
        shape = len(names), len(MEASURES), len(velocities)
        happened = padded([[_happened(one) for one in data]]).reshape(*shape, -1)
        whole_of = {name: whole for whole, several in self.models.items() for name in several}
        wholes = happened[[names.index(whole) for whole in whole_of.values()]]
        dims = "controller", "measure", "velocity"
        told = frequencies("frequency", happened, dims) | differences("more", happened, wholes, dims)
        axes = {"controller": names, "measure": list(MEASURES), "whole": ("controller", list(whole_of.values()))}
        settings: dict[str, Any] = {"study": "ablate"}
        settings |= {name: getattr(self, name) for name in ("n_starts", "n_physical", "periods", "seed")}
        settings |= {
            "conditions": self.conditions.settings(),
            "stride": asdict(self.stride),
            "observation_time": "walk",
        }
        settings |= {"controllers": {name: plain(one) for name, one in self.controllers.items()}}
        settings["not_printed"] = not_printed(
            {"controllers": {name: settings["controllers"][name] for name in self.models}}
        )
        return xr.Dataset(told, axes, attributes(settings)).assign_coords(velocity_axis(*self.observed))


def _happened(one: "xr.Dataset") -> np.ndarray:
    """What a cell counts, (start,), 0 or 1; NaN where a walk was refused."""
    if "lost" in one:
        return one.lost.values.astype(float)
    return came(one.fall).values if "fall" in one else 1.0 - one.stable.values
