"""The command `hexmj reproduce`."""

from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace

from hexmj.cli.command import Answer, Command, at_work
from hexmj.cli.options import Output, Workers, build
from hexmj.cli.output import table


@dataclass(frozen=True)
class ReproduceOptions:
    """Options of `hexmj reproduce` that `Reproduction` does not have."""

    out: Path = Path("results/reproduce")
    """Folder for the table (Markdown, JSON), the figures and cached measurements."""


class Reproduce(Command):
    """Reproduce Section 5 of the 1998 paper: compare every claim with hexmj's number, and draw Figures 2 to 6, phase
    histograms and footfall diagrams. Repeat the command to resume a stopped run."""

    sources = (ReproduceOptions, "paper.protocol:Reproduction", Output, Workers)
    examples = ("--quick", "--only hws-close p4 --beside lasting --json")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.paper.protocol import Reproduction
        from hexmj.paper.reproduce import reproduce
        from hexmj.plotting import as_shipped

        plan = build(Reproduction, given)
        with at_work(given, "reproducing") as execution, as_shipped():
            report = reproduce(given.out, plan.protocol, plan.only, plan.beside, **execution)
        settings = {"protocol": asdict(report.protocol), "only": plan.only, "beside": plan.beside}
        p = plan.protocol
        starts = f"The claims of the 1998 paper: FLSS of {p.samples} x {p.sample} starts at each velocity, gaits of"
        starts += f" {p.gait_starts} starts, walks after obstacles of {p.obstacle_starts} starts; seed {p.seed}"
        about = "walk, start: observation times; *: calibrates a constant of hexmj; claims.md: intervals and reasons"
        lines = [starts, table(*report.table(short=True), None), about, *report.summary]
        return Answer(report.json(), lines, report.files, settings)
