"""`hexmj check-controller`."""

import sys
from dataclasses import asdict, dataclass

from tyro.conf import Positional

from hexmj.cli.options import ControllerName
from hexmj.cli.tables import print_json


@dataclass(frozen=True)
class CheckController:
    """Does a controller keep the protocol?  A check that fails says in a sentence what is wrong; exit code 1 then."""

    name: Positional[ControllerName]
    json: bool = False
    """Print one JSON object on standard output, nothing else."""

    def run(self) -> None:
        """One line for each check."""
        from hexmj.controllers.conformance import findings
        from hexmj.controllers.named import load_controller

        checks = []
        for finding in findings(load_controller(self.name)):
            checks.append(finding)
            if not self.json:
                print(f"{'well ' if finding.well else 'WRONG'}  {finding.name}: {finding.found}", flush=True)
        well = all(finding.well for finding in checks)
        if self.json:
            print_json({"controller": self.name, "well": well, "checks": [asdict(finding) for finding in checks]})
        sys.exit(0 if well else 1)
