"""`hexmj reproduce`."""

from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace

from hexmj.cli.command import Answer, Command, at_work
from hexmj.cli.options import Output, Workers, build
from hexmj.cli.output import table


@dataclass(frozen=True)
class ReproduceOptions:
    """Options of a reproduction."""

    out: Path = Path("results/reproduce")
    """Folder for the table (Markdown, JSON), the figures and cached measurements."""


class Reproduce(Command):
    """Reproduce Section 5 of the 1998 paper: every claim with our number and verdict, Figures 2 to 6, phase histograms
    and footfall diagrams. A run that was stopped resumes if it is repeated."""

    sources = (ReproduceOptions, "paper.protocol:Reproduction", Output, Workers)
    examples = ("--quick", "--only hws-close p4 --beside lasting --json")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.paper.protocol import Reproduction
        from hexmj.paper.reproduce import reproduce
        from hexmj.plotting import as_shipped

        chosen = build(Reproduction, given)
        with at_work(given, "reproducing") as execution, as_shipped():
            report = reproduce(given.out, chosen.protocol, chosen.only, chosen.beside, **execution)
        settings = {"protocol": asdict(report.protocol), "only": chosen.only, "beside": chosen.beside}
        lines = ["The claims of the 1998 paper", table(*report.table()), *report.summary]
        return Answer(report.json(), lines, report.files, settings)
