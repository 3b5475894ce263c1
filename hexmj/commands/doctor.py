"""`hexmj doctor`."""

import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

from hexmj.commands.printing import print_json
from hexmj.trust.machine import examine

if TYPE_CHECKING:
    from hexmj.cli import Doctor


def run_doctor(options: "Doctor") -> None:
    """`hexmj doctor`: one line for each check; exit code 1 if one fails."""
    findings = []
    for finding in examine():
        findings.append(finding)
        if not options.json:
            remedy = f"; remedy: {finding.remedy}" if finding.remedy else ""
            print(f"{'well ' if finding.well else 'WRONG'}  {finding.name}: {finding.found}{remedy}", flush=True)
    well = all(finding.well for finding in findings)
    if options.json:
        print_json({"well": well, "checks": [asdict(finding) for finding in findings]})
    sys.exit(0 if well else 1)
