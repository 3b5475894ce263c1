"""`hexmj reproduce`."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import SimpleNamespace

from hexmj.cli.command import Command, at_work
from hexmj.cli.options import Output, Workers
from hexmj.cli.output import print_json, show, table
from hexmj.validate import distinct


@dataclass(frozen=True)
class ReproduceOptions:
    """Options of a reproduction."""

    seed: int = 1998
    """Seed of the random starts; the ideal weight sets were searched with 0 and 1."""
    out: Path = Path("results/reproduce")
    """Folder for the table (Markdown, JSON), the figures and cached measurements."""
    quick: bool = False
    """Fewer starts and velocities, and coarser steps of gaits: under a minute instead of several."""
    only: tuple[str, ...] = ()
    """Keys of the claims to judge, without figures; by default all."""
    beside: tuple[str, ...] = ()
    """Model variants under which the claims are judged too, such as 'lasting'."""


class Reproduce(Command):
    """Reproduce Section 5 of the 1998 paper: every claim with our number and verdict, Figures 2 to 6, phase histograms
    and footfall diagrams. A run that was stopped resumes if it is repeated."""

    sources = (ReproduceOptions, Output, Workers)
    examples = ("--quick", "--only hws-close p4 --beside lasting --json")

    def run(self, given: SimpleNamespace) -> None:
        from hexmj.io import MANIFEST, results_folder, save_manifest
        from hexmj.paper.protocol import FULL, QUICK
        from hexmj.paper.reproduce import reproduce
        from hexmj.paper.table import (
            cells_beside,
            claims_json,
            heads,
            heads_beside,
            on_searched_starts,
            summary,
            summary_beside,
        )
        from hexmj.plotting import as_shipped

        for name in ("only", "beside"):
            if getattr(given, name):
                distinct(f"--{name}", getattr(given, name))
        results_folder(given.out)
        protocol = replace(QUICK if given.quick else FULL, seed=given.seed)
        with at_work(given, "reproducing") as execution, as_shipped():
            rows, files = reproduce(given.out, protocol, given.only, given.beside, **execution)
        settings = {"protocol": asdict(protocol), "only": given.only, "beside": given.beside}
        files.append(save_manifest(given.command, settings, files, given.out / MANIFEST))
        if given.json:
            print_json(claims_json(rows, asdict(protocol)) | {"files": files})
            return
        alone = [replace(row, beside={}) for row in rows]
        others = [table(heads_beside(name), cells_beside(rows, name)) for name in given.beside]
        lines = *summary(rows), *on_searched_starts(given.seed), *summary_beside(rows)
        claims = table(heads(alone), [row.cells for row in alone])
        show("The claims of the 1998 paper", claims, *others, *lines, *map(str, files))
