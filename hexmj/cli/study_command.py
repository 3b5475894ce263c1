"""What commands that conduct a study have in common: walk with a progress bar, keep what is finished, write, print."""

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tyro.conf import OmitArgPrefixes

from hexmj.cli.options import Figures
from hexmj.cli.sweepers import Sweepers
from hexmj.cli.tables import print_json, save_figure, show
from hexmj.cli.walking_command import WalkingCommand
from hexmj.io import MANIFEST, results_folder, save, save_manifest, settings
from hexmj.sweep import Study, run_study

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Outputs:
    """What a study is written to."""

    doing: str
    """What the progress bar says meanwhile."""
    data: str
    """Name of the NetCDF file."""
    figures: "Mapping[str, Callable[[xr.Dataset], Figure]]"
    """By the names of their files as PNG."""
    manifest: str = MANIFEST
    """Name of its file."""
    others: tuple[str, ...] = ()
    """Names of files that the command writes itself."""


@dataclass(frozen=True)
class StudyCommand(WalkingCommand):
    """Base of the commands that conduct a study."""

    outputs: ClassVar[Outputs]
    """What is written."""
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)
    drawn: OmitArgPrefixes[Figures] = field(default_factory=Figures)
    out: Path = Path("results")
    """Folder for figure, NetCDF, manifest and finished walks."""

    def study(self) -> Study:
        """What is to be conducted; its cells name the function that walks."""
        raise NotImplementedError

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """What is printed as JSON: everything but the single starts."""
        return lists_of(result.drop_dims("start", errors="ignore"))

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """What is printed otherwise: tables and lines."""
        raise NotImplementedError

    def write_others(self, result: "xr.Dataset") -> list[Path]:
        """Write what else comes of the result; the files."""
        return []

    def run(self) -> None:
        """Conduct the study in the folder, write its result, and print."""
        study, outputs = self.study(), self.outputs
        figures = {self.drawn.named(name): draw for name, draw in outputs.figures.items()}
        folder = results_folder(self.out)
        with self.sweepers.at_work(outputs.doing) as how:
            result = run_study(study, folder / "walks", **how)
        files = [
            save(result, folder / outputs.data),
            *(save_figure(draw, result, folder / name) for name, draw in figures.items()),
            *self.write_others(result),
        ]
        files.append(save_manifest(sys.argv[1:], settings(result), files, folder / outputs.manifest))
        if self.json:
            print_json(self.summary(result) | {"searched": self.searched, "files": files})
        else:
            show(*self.shown(result), *map(str, files))


def lists_of(result: "xr.Dataset") -> dict[str, Any]:
    """All coordinates and variables of a result as lists, and its settings, for JSON."""
    return {str(name): result[name].values.tolist() for name in result.variables} | {"settings": settings(result)}
