"""Checks whose findings are printed as they come: of a controller, or of this machine."""

import sys
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, NoReturn

from hexmj.cli.tables import print_json


def report(findings: Iterable[Any], json: bool, **beside: Any) -> NoReturn:
    """One line for each finding, or one JSON object with what is `beside`; ends the program, with exit code 1 if one is
    not well.  Findings are frozen dataclasses with `name`, `well` and `found`, and perhaps a `remedy` or `note`."""
    told = []
    for finding in findings:
        told.append(finding)
        if not json:
            remedy = f"; remedy: {finding.remedy}" if getattr(finding, "remedy", "") else ""
            kind = "note " if getattr(finding, "note", False) else "well " if finding.well else "WRONG"
            print(f"{kind}  {finding.name}: {finding.found}{remedy}", flush=True)
    well = all(finding.well for finding in told)
    if json:
        print_json(beside | {"well": well, "checks": [asdict(finding) for finding in told]})
    sys.exit(0 if well else 1)
