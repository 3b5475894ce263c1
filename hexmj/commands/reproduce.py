"""`hexmj reproduce`."""

from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from hexmj.commands.printing import new_table, print_json, show
from hexmj.progress import progress_bar

if TYPE_CHECKING:
    from hexmj.cli import Reproduce


def run_reproduce(options: "Reproduce") -> None:
    """`hexmj reproduce`: the paper's claims, judged, and its figures."""
    from hexmj.paper.protocol import FULL, QUICK
    from hexmj.paper.reproduce import reproduce
    from hexmj.paper.table import HEADS, claims_json, summary

    protocol = replace(QUICK if options.quick else FULL, seed=options.seed)
    with progress_bar("reproducing") as progress:
        rows, files = reproduce(options.out, protocol, only=options.only, progress=progress)
    if options.json:
        print_json(claims_json(rows, asdict(protocol)) | {"files": files})
    else:
        table = new_table(*HEADS)
        for row in rows:
            table.add_row(*row.cells)
        show("The claims of the 1998 paper", table, *summary(rows), *map(str, files))
