"""`hexmj readings`."""

import sys
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from tyro.conf import OmitArgPrefixes

from hexmj.checks import whole
from hexmj.cli.study_command import lists_of
from hexmj.cli.sweepers import Sweepers
from hexmj.cli.tables import print_json, save_figure, show, table
from hexmj.errors import InputError
from hexmj.files import write_text
from hexmj.io import MANIFEST, attributes, results_folder, save, save_manifest
from hexmj.starts import MOST_DRAWN, check_draw
from hexmj.validate import distinct


@dataclass(frozen=True)
class Readings:
    """Options of `hexmj readings`, which `commands.COMMANDS` describes."""

    only: tuple[str, ...] | None = None
    """Named readings alone ('lasting'), beside 'printed'; every combination of choices unless given."""
    best: int | None = None
    """How many of them are looked at more closely, with ideal sets searched under each; 12, or all of fewer, unless
    given."""
    starts: int = 300
    """Random starts of each curve."""
    gait_starts: int = 20
    """Random starts of each gait."""
    seed: int = 1998
    """Seed of the random starts."""
    out: Path = Path("results/readings")
    """Folder for the page (Markdown), the scores (NetCDF), the figure and what was scored."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)

    def run(self) -> None:
        """Score, rank, draw, and print the best."""
        from hexmj.controllers.cruse1998.model_variants import named_variant
        from hexmj.paper.readings import combinations, compare_readings, ranking
        from hexmj.paper.readings_figure import readings_figure
        from hexmj.paper.readings_page import HEADS, readings_markdown, readings_rows
        from hexmj.paper.scores import IDEAL, SCORING

        if self.only == ():
            raise InputError("--only without names; expected at least one, or no --only for all")
        for name in ("starts", "gait_starts"):
            whole(f"--{name.replace('_', '-')}", getattr(self, name), 1, MOST_DRAWN)
        check_draw(self.starts, self.seed)
        if self.seed == IDEAL.seed:
            raise InputError(f"--seed = {self.seed}; expected another, since ideal sets are searched on its starts")
        protocol = replace(SCORING, sample=self.starts, gait_starts=self.gait_starts, seed=self.seed)
        model_variants = list(combinations(protocol))
        if self.only:
            distinct("--only", self.only)
            named = [named_variant(name) for name in dict.fromkeys(("printed", *self.only))]
            model_variants = [replace(protocol, model_variant=one) for one in named]
        best = min(12, len(model_variants)) if self.best is None else self.best
        if not 1 <= best <= len(model_variants):
            raise InputError(f"--best = {best}; expected 1 to {len(model_variants)}, as many readings as are tried")
        out = results_folder(self.out)
        with self.sweepers.at_work("model_variant") as how:
            scores = compare_readings(model_variants, best, out / "scores", **how)
        scores.attrs |= attributes({"only": self.only or ()})
        files = [
            write_text(out / "readings.md", readings_markdown(scores, model_variants)),
            save(scores, out / "readings.nc"),
            save_figure(readings_figure, scores, out / "readings.png"),
        ]
        settings = {"protocol": asdict(protocol), "only": self.only or (), "best": best}
        files.append(save_manifest(sys.argv[1:], settings, files, out / MANIFEST))
        rows = readings_rows(scores, ranking(scores).tolist()[:best])
        if self.json:
            told = {"model_variants": [dict(zip(HEADS, row, strict=True)) for row in rows]}
            print_json(lists_of(scores) | told | {"files": files})
            return
        show("Readings of the 1998 paper", table(HEADS, rows), *map(str, files))
