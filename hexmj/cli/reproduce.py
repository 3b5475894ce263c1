"""`hexmj reproduce`."""

import sys
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from tyro.conf import OmitArgPrefixes

from hexmj.cli.sweepers import Sweepers
from hexmj.cli.tables import print_json, show, table
from hexmj.errors import InputError
from hexmj.io import MANIFEST, results_folder, save_manifest
from hexmj.validate import distinct


@dataclass(frozen=True)
class Reproduce:
    """Options of `hexmj reproduce`, which `commands.COMMANDS` describes."""

    quick: bool = False
    """Fewer starts and velocities, coarser steps of gaits, under a minute; the full protocol takes several."""
    only: tuple[str, ...] | None = None
    """Keys of the claims to judge, without figures; all unless given."""
    beside: tuple[str, ...] | None = None
    """Readings of the network under which the claims are judged, too, such as 'lasting'; see `hexmj readings`."""
    seed: int = 1998
    """Seed of the random starts; the ideal sets were searched with 0 and 1."""
    out: Path = Path("results/reproduce")
    """Folder for the table (Markdown, JSON), the figures and what was measured."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)

    def run(self) -> None:
        """Measure, judge, draw, and print the table."""
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

        if self.only == ():
            raise InputError("--only without keys; expected at least one, or no --only for all")
        if self.beside == ():
            raise InputError("--beside without names; expected at least one, or no --beside for none")
        for option, given in (("--only", self.only), ("--beside", self.beside)):
            if given:
                distinct(option, given)
        results_folder(self.out)
        beside = self.beside or ()
        protocol = replace(QUICK if self.quick else FULL, seed=self.seed)
        with self.sweepers.at_work("reproducing") as how, as_shipped():
            rows, files = reproduce(self.out, protocol, self.only or (), beside, **how)
        settings = {"protocol": asdict(protocol), "only": self.only or (), "beside": beside}
        files.append(save_manifest(sys.argv[1:], settings, files, self.out / MANIFEST))
        if self.json:
            print_json(claims_json(rows, asdict(protocol)) | {"files": files})
            return
        alone = [replace(row, beside={}) for row in rows]
        others = [table(heads_beside(name), cells_beside(rows, name)) for name in beside]
        lines = *summary(rows), *on_searched_starts(self.seed), *summary_beside(rows)
        claims = table(heads(alone), [row.cells for row in alone])
        show("The claims of the 1998 paper", claims, *others, *lines, *map(str, files))
