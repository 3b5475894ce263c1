"""`hexmj check-controller`."""

from collections.abc import Sequence
from dataclasses import dataclass

from tyro.conf import Positional

from hexmj.cli.findings import report
from hexmj.cli.options import ControllerName
from hexmj.controllers.conformance import VELOCITIES, findings
from hexmj.timing import Stride


@dataclass(frozen=True)
class CheckController:
    """Options of `hexmj check-controller`, which `commands.COMMANDS` describes."""

    name: Positional[ControllerName]
    velocities: Sequence[float] = VELOCITIES
    """V_r at which it is asked for plans, two or more, each 0 <= V < 1; those at which it can plan. It is asked to
    accelerate to them from 0.1, too, or from the least of them where all are above that, or none is; V and a step of
    that acceleration, 0.005 dt, are below 1 together."""
    dt: float = Stride.dt
    """Time step of the plans, of which 600 are looked at [time units]."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""

    def run(self) -> None:
        """One line for each check."""
        from hexmj.controllers.named import load_controller

        found = findings(load_controller(self.name), Stride(dt=self.dt), self.velocities)
        report(found, self.json, controller=self.name)
