"""`hexmj page`."""

import sys
from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from hexmj.cli.recorded import walk_summary
from hexmj.cli.tables import print_json, show
from hexmj.errors import InputError
from hexmj.io import MANIFEST, results_folder, save_manifest

NAME = "walk.html"


@dataclass(frozen=True)
class Page:
    """Options of `hexmj page`, which `commands.COMMANDS` describes."""

    recordings: Positional[tuple[Path, ...]] = ()
    """One recording, or two side by side with one clock (recording.nc of `hexmj walk`)."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    out: Path = Path("results/page")
    """Folder for the page."""

    def run(self) -> None:
        """Write the page."""
        from hexmj.replay.page.page import MOST, page
        from hexmj.replay.recording import load_recording

        if not 1 <= len(self.recordings) <= MOST:
            raise InputError(
                f"{len(self.recordings)} recordings were given; expected 1 or {MOST}, as recording.nc of hexmj walk"
            )
        shown = [load_recording(path) for path in self.recordings]
        out = results_folder(self.out)
        manifest = f"{NAME}-{MANIFEST}"
        files = [page(shown, out / NAME)]
        settings = {"recordings": [str(path) for path in self.recordings]}
        files.append(save_manifest(sys.argv[1:], settings, files, out / manifest))
        if self.json:
            print_json({"files": files, "recordings": [walk_summary(one) for one in shown]})
        else:
            size = files[0].stat().st_size / 1e6
            show(f"{size:.1f} MB; opens in any browser, without a network", *map(str, files))
