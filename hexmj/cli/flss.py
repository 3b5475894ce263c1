"""`hexmj flss`."""

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import ControllerName, Figures
from hexmj.cli.sweepers import Sweepers
from hexmj.cli.tables import four_digits, physical_report, print_json, report_line, save_figure, show, table
from hexmj.cli.walking_command import WalkingCommand
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError
from hexmj.io import MANIFEST, attributes, results_folder, save, save_manifest, settings
from hexmj.starts import SAMPLE

if TYPE_CHECKING:
    import xarray as xr

FINISHED = "walks"
"""Folder in that of the results, for what is finished."""


@dataclass(frozen=True)
class Flss(WalkingCommand):
    """Options of `hexmj flss`, which `commands.COMMANDS` describes."""

    model: ControllerName = "ldvs"
    velocities: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Velocities V_r as fractions of V_p, 0 <= V < 1; when accelerating, the final ones."""
    physical: bool = False
    """Count falls of the insect in MuJoCo instead of losses of the planned polygon."""
    starts: int | None = None
    """Number of random starts; 7000 unless given (seven samples of 1000, as in the paper), 200 if physical."""
    range_of: int | None = None
    """Starts that are computed and kept as one, if kinematic; 1600000 unless given.  No result depends on it."""
    out: Path | None = None
    """Folder for figure, NetCDF, manifest and what is finished; none are written unless given."""
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)
    drawn: OmitArgPrefixes[Figures] = field(default_factory=Figures)

    @property
    def kind(self) -> str:
        """Which measure it is."""
        return "physical" if self.physical else "kinematic"

    @property
    def n_starts(self) -> int:
        """Number of random starts."""
        return self.starts if self.starts is not None else 200 if self.physical else 7 * SAMPLE

    def run(self) -> None:
        """Measure, write what is asked for, and print."""
        if not self.physical:
            self.refuse_physical("without --physical")
        elif self.range_of is not None:
            raise InputError(f"--range-of = {self.range_of} with --physical; expected it with kinematic walks only")
        controller = self.controlled.controller(self.model)
        self.refuse_contact_gap(controller)
        if self.out:
            results_folder(self.out)
        elif self.drawn != Figures():
            raise InputError(f"--format {self.drawn.format} without --out; expected it where a figure is written")
        result = self._measured(controller)
        result.attrs |= attributes({"model": self.model, "physical": self.physical})
        self._print(result, self._write(result, self.out) if self.out else [])

    def _measured(self, controller: Controller) -> "xr.Dataset":
        how: Any = self.walked | {"n_starts": self.n_starts, "folder": self.out and self.out / FINISHED}
        with self.sweepers.at_work(f"{self.kind} FLSS") as execution:
            how |= execution
            if self.physical:
                from hexmj.measures.compare import physical_flss

                return physical_flss(controller, self.velocities, conditions=self.conditions, **how)
            from hexmj.measures.kinematic import RANGE, flss

            return flss(controller, self.velocities, range_of=RANGE if self.range_of is None else self.range_of, **how)

    def _write(self, result: "xr.Dataset", out: Path) -> list[Path]:
        from hexmj.measures.figures import flss_figure

        files = [
            save(result, out / "flss.nc"),
            save_figure(flss_figure, result, out / self.drawn.named("flss.png")),
        ]
        return [*files, save_manifest(sys.argv[1:], settings(result), files, out / MANIFEST)]

    def _print(self, result: "xr.Dataset", files: list[Path]) -> None:
        from hexmj.measures.figures import starts_in_words

        columns = [str(name) for name, values in result.items() if values.dims == ("velocity",)]
        report = physical_report(result) if self.physical else {}
        if self.json:
            lists = {"velocity": result.velocity.values.tolist()} | {c: result[c].values.tolist() for c in columns}
            told = {"settings": settings(result), "searched": self.searched, "files": files}
            print_json(lists | ({"report": report} if report else {}) | told)
            return
        columns = [name for name in columns if result[name].notnull().any()]  # no sample_sd of less than two samples
        at = {v: result.sel(velocity=v) for v in result.velocity.values}
        rows = [(f"{v:g}", *(four_digits(one[c].item()) for c in columns)) for v, one in at.items()]
        lines = [self.conditions_line(self.physical), *([report_line(report)] if report else [])]
        show(
            f"{self.kind} FLSS of {self.model}, {starts_in_words(self.n_starts)}",
            table(("V", *columns), rows),
            *lines,
            *map(str, files),
        )
