"""What Section 5 simulates: measurements, each of a few seconds, in which the paper's claims are looked up.

A measurement is taken velocity by velocity.  It keeps the outcome of every start, so that curves can be compared on
the same starts and samples of 1000 can be formed afterwards.
"""

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.gaits import PAIRS, limit_gait
from hexmj.legs import LEGS
from hexmj.loss_frequency import SAMPLE, WINDOWS, draw_starts, observation_time
from hexmj.network import NetworkRun, first_loss, steps_within
from hexmj.paper.found_sets import found_set
from hexmj.paper.late_losses import lost_after
from hexmj.parameters import Acceleration, Model, Network, Symmetric
from hexmj.presets import PRESETS

if TYPE_CHECKING:
    import xarray as xr

NO_SET = -1
"""Stands for the outcome where no set has been searched yet."""

LATE_PERIODS = 5
"""Periods of a single leg oscillator, (AEP_0 - PEP_0) (1 + 1/V), after which Section 5.2 looks again."""

WIDE = (0.1, 0.7)
"""The range on which the paper could not fit a hard-wired system."""


@dataclass(frozen=True)
class Protocol:
    """How much is simulated; the defaults are the paper's."""

    samples: int = 7
    """Samples of starts; their means and deviations make the curves of Figs. 2-4."""
    sample: int = SAMPLE
    """Starts of one sample."""
    velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 19))
    """Velocities of Figs. 2-4, 0.1 to 0.9."""
    gait_starts: int = 100
    """Starts of each gait in Section 5.3."""
    gait_velocities: tuple[float, ...] = tuple(round(0.05 * n, 2) for n in range(2, 20))
    """Velocities of Figs. 5 and 6, 0.1 to 0.95."""
    footfall_velocities: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7, 0.9)
    """Velocities of the footfall diagrams."""
    seed: int = 1998
    """Of all starts; another than those of the searches that found the ideal sets."""
    network: Network = field(default_factory=Network)
    """Constants of the walks whose stability is measured."""
    gait_network: Network = field(default_factory=lambda: Network(dt=0.01))
    """Constants of the gaits; the time step is that of Figs. 5 and 6."""
    acceleration: Acceleration = field(default_factory=Acceleration)
    """Eq. 11, for the accelerated walks and all gaits."""

    @property
    def starts(self) -> np.ndarray:
        """All starts of Figs. 2-4, (start, leg) [mm]."""
        return draw_starts(self.samples * self.sample, self.seed, self.network)


FULL = Protocol()
"""The paper's: seven times 1000 starts, gaits from 100."""

QUICK = Protocol(
    sample=100,
    velocities=(0.1, 0.2, 0.3, 0.4, 0.45, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9),
    gait_starts=10,
    gait_velocities=(0.1, 0.25, 0.4, 0.6, 0.8, 0.95),
)
"""A tenth of the starts, about half of the velocities."""


@dataclass(frozen=True)
class Losses:
    """Which starts lose static stability under both windows: Figs. 2-4."""

    model: str
    """A preset, or 'ideal' (Problem 1) or 'wide' (Problem 2 on [0.1, 0.7]) of the table of found sets."""
    accelerated: bool = False
    """Walk with Eq. 11."""
    late: bool = False
    """Look only after five periods of a single leg."""

    def velocities(self, protocol: Protocol) -> tuple[float, ...]:
        """Where it is measured."""
        return protocol.velocities

    def at(self, v: float, protocol: Protocol) -> "xr.Dataset":
        """Outcomes (window, start): 1 lost, 0 not, -1 where no set is known."""
        import xarray as xr

        starts = protocol.starts
        lost = np.full((len(WINDOWS), len(starts)), NO_SET, dtype=np.int8)
        models = [_model(self.model, window, v) for window in WINDOWS]
        for model in {id(one): one for one in models if one is not None}.values():
            rows = [row for row, one in enumerate(models) if one is model]
            lost[rows] = self._lost(starts, model, v, [WINDOWS[row] for row in rows], protocol)
        return xr.Dataset({"lost": (("window", "start"), lost)}, {"window": list(WINDOWS)})

    def _lost(self, starts: np.ndarray, model: Model, v: float, windows: list[str], protocol: Protocol) -> np.ndarray:
        """(window, start), from one walk that lasts as long as the longest window."""
        network = protocol.network
        acceleration = protocol.acceleration if self.accelerated else None
        durations = np.array([observation_time(w, np.array(v), network, acceleration) for w in windows])
        if self.late:
            return lost_after(starts, model, v, LATE_PERIODS * _period(v, network), durations, network=network)
        times = first_loss(starts, model, v, durations.max(), network=network, acceleration=acceleration)
        return times < (steps_within(durations, network)[:, np.newaxis] + 0.5) * network.dt

    def settings(self, v: float, protocol: Protocol) -> dict[str, Any]:
        """All that its outcomes depend on."""
        models = [_model(self.model, window, v) for window in WINDOWS]
        return {
            "sets": [asdict(one) if isinstance(one, Symmetric) else None for one in models],
            "starts": protocol.samples * protocol.sample,
            "seed": protocol.seed,
            "network": asdict(protocol.network),
            "acceleration": asdict(protocol.acceleration) if self.accelerated else None,
            "late": self.late,
        }


@dataclass(frozen=True)
class Gaits:
    """The limit regimes of one preset: Figs. 5 and 6 with Eq. 11, or without it as in Section 5.2."""

    model: str
    accelerated: bool = True

    def velocities(self, protocol: Protocol) -> tuple[float, ...]:
        """Where it is measured."""
        return protocol.gait_velocities if self.accelerated else protocol.velocities

    def at(self, v: float, protocol: Protocol) -> "xr.Dataset":
        """Phases (start, pair), periods (start, leg) and what is true of each start's regime."""
        import xarray as xr

        network, acceleration = self._constants(protocol)
        conditions: Any = {"network": network, "acceleration": acceleration}
        starts = draw_starts(protocol.gait_starts, protocol.seed, network)
        duration = observation_time("walk", np.array(v), network, acceleration)
        times = first_loss(starts, PRESETS[self.model], v, duration, **conditions)
        gait = limit_gait(PRESETS[self.model], v, starts=len(starts), seed=protocol.seed, **conditions)
        return xr.Dataset(
            {
                "phase": (("start", "pair"), gait.phase, {"units": "1"}),
                "periods": (("start", "leg"), gait.periods, {"units": "time unit"}),
                "duty_factor": (("start", "leg"), gait.duty_factor, {"units": "1"}),
                "reached": ("start", gait.reached, {"units": "time unit"}),
                "periodic": ("start", gait.periodic),
                "stable": ("start", gait.stable),
                "lost": ("start", np.isfinite(times), {"long_name": "static stability lost on the way"}),
            },
            {"pair": list(PAIRS), "leg": list(LEGS)},
        )

    def _constants(self, protocol: Protocol) -> tuple[Network, Acceleration | None]:
        return (protocol.gait_network, protocol.acceleration) if self.accelerated else (protocol.network, None)

    def settings(self, v: float, protocol: Protocol) -> dict[str, Any]:
        """All that its outcomes depend on."""
        network, acceleration = self._constants(protocol)
        return {
            "starts": protocol.gait_starts,
            "seed": protocol.seed,
            "network": asdict(network),
            "acceleration": asdict(acceleration) if acceleration else None,
        }


@dataclass(frozen=True)
class Footfall:
    """The states of all legs in the accelerated walk of one start, over three periods of its limit regime."""

    model: str

    def velocities(self, protocol: Protocol) -> tuple[float, ...]:
        """Where it is measured."""
        return protocol.footfall_velocities

    def at(self, v: float, protocol: Protocol) -> "xr.Dataset":
        """Stance (time, leg), over time in periods of a single leg."""
        import xarray as xr

        network, acceleration = protocol.network, protocol.acceleration
        start, period = draw_starts(1, protocol.seed, network), _period(v, network)
        run = NetworkRun(start, PRESETS[self.model], v, network=network, acceleration=acceleration)
        settled = int(steps_within((v - acceleration.start) / acceleration.rate + 10 * period, network))
        while run.done < settled:
            run.advance(min(20_000, settled - run.done))
        seen = run.advance(int(steps_within(3 * period, network))).stance[:, 0]
        time = np.linspace(0, 3, 1201)
        return xr.Dataset(
            {"stance": (("time", "leg"), seen[np.round(time / 3 * (len(seen) - 1)).astype(int)])},
            {"time": ("time", time, {"units": "periods of a single leg"}), "leg": list(LEGS)},
        )

    def settings(self, v: float, protocol: Protocol) -> dict[str, Any]:
        """All that its outcomes depend on."""
        constants = {"network": asdict(protocol.network), "acceleration": asdict(protocol.acceleration)}
        return {"seed": protocol.seed} | constants


Measurement = Losses | Gaits | Footfall

MEASUREMENTS: dict[str, Measurement] = {
    "uncoordinated": Losses("uncoordinated"),
    "hws": Losses("hws"),
    "ldvs": Losses("ldvs"),
    "ideal": Losses("ideal"),
    "wide": Losses("wide"),
    "hws late": Losses("hws", late=True),
    "ldvs late": Losses("ldvs", late=True),
    "hws accelerated": Losses("hws", accelerated=True),
    "ldvs accelerated": Losses("ldvs", accelerated=True),
    "hws regimes": Gaits("hws", accelerated=False),
    "ldvs regimes": Gaits("ldvs", accelerated=False),
    "hws gaits": Gaits("hws"),
    "ldvs gaits": Gaits("ldvs"),
    "hws footfall": Footfall("hws"),
    "ldvs footfall": Footfall("ldvs"),
}
"""All that is simulated, by name."""

COSTS = {
    "hws accelerated": 25.0, "ldvs accelerated": 25.0, "hws gaits": 80.0, "ldvs gaits": 80.0,
    "hws late": 5.0, "ldvs late": 5.0, "hws regimes": 7.0, "ldvs regimes": 7.0,
}  # fmt: skip
"""Seconds that the long ones take on two cores, for the progress bar; the others take about one."""


def _model(name: str, window: str, velocity: float) -> Model | None:
    if name == "ideal":
        return found_set(window, velocity)
    return found_set(window, *WIDE) if name == "wide" else PRESETS[name]


def _period(v: float, network: Network) -> float:
    """Period of a single leg oscillator [time units]."""
    return (network.aep0 - network.pep0) * (1 + 1 / v)
