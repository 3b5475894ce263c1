"""`hexmj reproduce` and `hexmj biology`: comparisons with the literature."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import STUDY, Answer, Command, StudyCommand, at_work
from hexmj.cli.options import Output, Workers, build
from hexmj.cli.output import table

if TYPE_CHECKING:
    import xarray as xr


class Reproduce(Command):
    """Reproduce Section 5 of the 1998 paper: compare every claim with hexmj's number, and draw Figures 2 to 6. Repeat
    the command to resume a stopped run."""

    sources = ("paper.protocol:Reproduction", Output, Workers)
    examples = ("--quick", "--only hws-close p4 --beside lasting --json")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.paper.protocol import Reproduction
        from hexmj.paper.reproduce import reproduce
        from hexmj.plotting import as_shipped

        plan = build(Reproduction, given)
        with at_work(given, "reproducing") as execution, as_shipped():
            report = reproduce(given.out, plan.protocol, plan.only, plan.beside, **execution)
        settings = {"protocol": asdict(report.protocol), "only": plan.only, "beside": plan.beside}
        starts = f"{plan.protocol.samples} x {plan.protocol.sample} starts at each velocity; seed {plan.protocol.seed}"
        about = "walk, start: observation times; *: calibrates a constant of hexmj; claims.md: intervals and reasons"
        lines = [starts, table(*report.table(short=True), None), about, *report.summary]
        return Answer(report.json(), lines, report.files, settings)


class Biology(StudyCommand):
    """Compare forces, torques, gait, posture and work of the simulated insect with measurements of real insects. Repeat
    the command to resume a stopped run."""

    study = "studies.biology:Biology"
    sources = (study, *STUDY)
    data = "biology.nc"
    figures = {"biology": "biology"}  # noqa: RUF012
    examples = ("--starts 5", "--controller walknet --vp 120 --out results/walknet")

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.studies.biology import table_rows, walked_in_words

        rows = [row[:4] for row in table_rows(result)]
        known = [row for row in rows if row[2] != "-"]

        yield f"{study.controller.name} and real insects, at 24 mm/s unless a row names another speed"
        yield table(("quantity", "ours (95 %)", "insects", "verdict"), known, None)
        yield f"biology.md has the sources, and {len(rows) - len(known)} more quantities without a figure for insects"
        yield f"Starts with complete strides: {walked_in_words(result)}"

    def write_more(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        from hexmj.files import write_text
        from hexmj.studies.biology import biology_markdown

        return [write_text(given.out / "biology.md", biology_markdown(result))]
