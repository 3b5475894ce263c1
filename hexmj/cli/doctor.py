"""`hexmj doctor`."""

import sys
from dataclasses import asdict, dataclass

from hexmj.cli.tables import print_json


@dataclass(frozen=True)
class Doctor:
    """Checks of this machine, each with a remedy where it fails; exit code 1 if one does."""

    json: bool = False
    """Print one JSON object on standard output, nothing else."""

    def run(self) -> None:
        """One line for each check."""
        from hexmj.machine import examine

        findings = []
        for finding in examine():
            findings.append(finding)
            if not self.json:
                remedy = f"; remedy: {finding.remedy}" if finding.remedy else ""
                print(f"{'well ' if finding.well else 'WRONG'}  {finding.name}: {finding.found}{remedy}", flush=True)
        well = all(finding.well for finding in findings)
        if self.json:
            print_json({"well": well, "checks": [asdict(finding) for finding in findings]})
        sys.exit(0 if well else 1)
