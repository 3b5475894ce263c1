"""`hexmj check-controller`."""

from dataclasses import dataclass

from tyro.conf import Positional

from hexmj.cli.findings import report
from hexmj.cli.options import ControllerName


@dataclass(frozen=True)
class CheckController:
    """Options of `hexmj check-controller`, which `commands.COMMANDS` describes."""

    name: Positional[ControllerName]
    json: bool = False
    """Print one JSON object on standard output, nothing else."""

    def run(self) -> None:
        """One line for each check."""
        from hexmj.controllers.conformance import findings
        from hexmj.controllers.named import load_controller

        report(findings(load_controller(self.name)), self.json, controller=self.name)
