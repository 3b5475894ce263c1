"""`hexmj compare`."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import arg

from hexmj.cli.options import CONTROLLER
from hexmj.cli.recorded import recorded
from hexmj.cli.study_command import Outputs, StudyCommand
from hexmj.cli.tables import four_digits, interval, physical_report, report_line, table
from hexmj.errors import InputError, RenderingError
from hexmj.io import settings
from hexmj.measures.compare import AGREEMENT, BESIDE, MEASURES, Comparison
from hexmj.measures.figures import comparison_figure

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

SUMMARY = ("velocity", "report", "settings", "searched", "files")
"""What stands beside the controllers in the JSON."""

RECORDING, FILM = "recording.nc", "gait.mp4"
"""Files for one gait."""

FILMED = 0.3
"""V_r near which a gait is filmed."""


@dataclass(frozen=True)
class Compare(StudyCommand):
    """Options of `hexmj compare`, which `commands.COMMANDS` describes."""

    models: Annotated[tuple[str, ...], arg(help=f"Controllers, each {CONTROLLER}.")] = ("ldvs", "uncoordinated")
    velocities: Sequence[float] = Comparison.velocities
    """Velocities V_r as fractions of V_p, 0 <= V < 1; when accelerating, the final ones."""
    starts: int = Comparison.n_starts
    """Number of random starts, the same for every controller and velocity."""
    out: Path = Path("results/compare")
    """Folder for the results and finished walks."""
    no_video: bool = False
    """Leave the video out."""
    outputs = Outputs("comparing", "comparison.nc", {"comparison.png": comparison_figure}, others=(RECORDING, FILM))

    def study(self) -> Comparison:
        controllers = self.controlled.controllers(self.models)
        if clash := set(controllers) & set(SUMMARY):
            raise InputError(f"a controller has the name {min(clash)!r}, which the results need; rename it")
        return Comparison(controllers, self.velocities, self.starts, conditions=self.conditions, **self.walked)

    def write_others(self, result: "xr.Dataset") -> list[Path]:
        """The video, unless it is left out or cannot be made."""
        from hexmj.replay.film.video import render
        from hexmj.replay.recording import save_recording

        if self.no_video:
            return []
        walked = self._typical_gait(result)
        files = [save_recording(walked, self.out / RECORDING)]
        try:
            render([walked], self.out / FILM, progress=True)
            files.append(self.out / FILM)
        except RenderingError as error:
            print(f"hexmj: no video: {error}", file=sys.stderr)
        return files

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        """The frequencies and answers of every controller."""
        summary: dict[str, Any] = {"velocity": result.velocity.values.tolist()}
        keys = [measure + end for measure in MEASURES | BESIDE for end in ("", "_low", "_high")]
        keys += ["agreement", *AGREEMENT]
        for name in result.controller.values:
            one = result.sel(controller=name)
            summary[name] = {key: one[key].values.tolist() for key in keys}
        durations = {"duration": result.duration.values.tolist()}
        return summary | {"report": physical_report(result), "settings": settings(result) | durations}

    def shown(self, result: "xr.Dataset") -> Iterable[Any]:
        """The frequencies, what the starts did, the conditions, and how far the bodies did what they were told."""
        frequencies, answers = _tables(result)
        yield "Frequency of the loss of static stability, with 95 % intervals"
        yield frequencies
        yield (
            "Starts that lost on paper and fell (both), did either (kin., phys.) or none; speed over command, from the"
            " least to the greatest of those that did not fall"
        )
        yield answers
        yield self.conditions_line()
        yield report_line(physical_report(result))

    def _typical_gait(self, result: "xr.Dataset") -> "xr.Dataset":
        """A recording of the first controller near V = 0.3, of the first start that kept its stability, if any."""
        name, controller = next(iter(self.controlled.controllers(self.models).items()))
        velocities = result.velocity.values
        v = float(velocities[np.abs(velocities - FILMED).argmin()])
        one = result.sel(controller=name, velocity=v)
        start = int(np.argmax((np.isinf(one.planned_loss) & np.isinf(one.fall)).values))
        return recorded(self, controller, v, start, title=name, threads=self.sweepers.threads)


def _tables(result: "xr.Dataset") -> "tuple[Table, Table]":
    """A row for each controller and velocity: the frequencies, and what the starts did."""
    frequencies, answers = [], []
    for name in result.controller.values:
        for v in result.velocity.values:
            one = result.sel(controller=name, velocity=v)
            intervals = (interval(one, measure) for measure in MEASURES)
            frequencies.append((name, f"{v:g}", four_digits(one.duration.item()), *intervals))
            counts = [str(one[case].item()) for case in AGREEMENT]
            toppled = f"{one.toppled.item():.3f}"
            answers.append((name, f"{v:g}", f"{one.agreement.item():.2f}", *counts, toppled, _speeds(one)))
    told = ("agree", "both", "kin.", "phys.", "none", *BESIDE, "speed")
    return table(("controller", "V", "t", *MEASURES), frequencies), table(("controller", "V", *told), answers)


def _speeds(one: "xr.Dataset") -> str:
    """Least and greatest speed of the starts that did not fall, over the commanded one."""
    speed = one.speed.values[np.isinf(one.fall.values)]
    return f"{speed.min():.2f}-{speed.max():.2f}" if np.isfinite(speed).any() else "-"
