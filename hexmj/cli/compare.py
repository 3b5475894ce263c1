"""`hexmj compare`."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import OmitArgPrefixes, arg

from hexmj.cli.options import CONTROLLER, Accelerating, Controlled, Sweepers, Walks
from hexmj.cli.recorded import recorded
from hexmj.cli.sweep import run_study
from hexmj.cli.tables import conditions_line, interval, new_table, physical_report, print_json, report_line, show
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError, RenderingError
from hexmj.measures.compare import AGREEMENT, MEASURES, Comparison
from hexmj.progress import progress_bar
from hexmj.replay.film.film import Film

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

SUMMARY = ("velocity", "report", "settings", "files")
"""What stands beside the controllers in the JSON."""

FILMED = 0.3
"""V_r near which a gait is filmed."""


@dataclass(frozen=True)
class Compare:
    """Kinematic, measured and physical FLSS on the same starts: table, figure, NetCDF, manifest and one gait video.

    Repeat the command to go on with a run that was stopped.
    """

    models: Annotated[tuple[str, ...], arg(help=f"Controllers, each {CONTROLLER}.")] = ("ldvs", "uncoordinated")
    velocities: Sequence[float] = Comparison.velocities
    """Velocities V_r as fractions of V_p, 0 <= V < 1; when accelerating, the final ones."""
    starts: int = Comparison.n_starts
    """Number of random starts, the same for every controller and velocity."""
    out: Path = Path("results/compare")
    """Folder for the results and finished walks."""
    no_video: bool = False
    """Leave the video out."""
    json: bool = False
    """Print one JSON object on standard output, nothing else."""
    walks: OmitArgPrefixes[Walks] = field(default_factory=Walks)
    accelerating: OmitArgPrefixes[Accelerating] = field(default_factory=Accelerating)
    controlled: OmitArgPrefixes[Controlled] = field(default_factory=Controlled)
    sweepers: OmitArgPrefixes[Sweepers] = field(default_factory=Sweepers)
    conditions: OmitArgPrefixes[Conditions] = field(default_factory=Conditions)

    def run(self) -> None:
        """Compare, write the results and a video, and print."""
        from hexmj.measures.figures import comparison_figure

        controllers = self.controlled.controllers(self.models)
        if clash := set(controllers) & set(SUMMARY):
            raise InputError(f"a controller has the name {min(clash)!r}, which the results need; rename it")
        study = Comparison(
            controllers,
            self.velocities,
            self.starts,
            self.walks.time,
            self.walks.seed,
            self.conditions,
            self.walks.stride,
            self.accelerating.procedure,
        )
        result, files = run_study(
            study, "comparing", self.out, self.sweepers,
            data="comparison.nc",
            figures={"comparison.png": comparison_figure},
            also=("recording.nc", "gait.mp4"),
        )  # fmt: skip
        no_video = None
        if not self.no_video:
            try:
                files.append(self._typical_gait(study.controllers, result))
            except RenderingError as error:
                no_video = error
        if self.json:
            print_json(_summary(result) | {"files": files})
        else:
            frequencies, answers = _tables(result)
            show(
                "Frequency of the loss of static stability, with 95 % intervals",
                frequencies,
                "Starts by what happened: lost on paper (kin.), fell (phys.); speed over command",
                answers,
                conditions_line(self.walks, self.controlled, self.accelerating.procedure, self.conditions),
                report_line(physical_report(result)),
                *map(str, files),
            )
        if no_video:
            print(f"hexmj: no video: {no_video}", file=sys.stderr)

    def _typical_gait(self, controllers: Mapping[str, Controller], result: "xr.Dataset") -> Path:
        """A video of the first controller near V = 0.3, of the first start that kept its stability, if any."""
        from hexmj.replay.film import gl
        from hexmj.replay.film.video import render
        from hexmj.replay.recording import save_recording

        if sentence := gl.missing():
            raise RenderingError(sentence)
        name, controller = next(iter(controllers.items()))
        velocities = result.velocity.values
        v = float(velocities[np.abs(velocities - FILMED).argmin()])
        one = result.sel(controller=name, velocity=v)
        start = int(np.argmax((np.isinf(one.planned_loss) & np.isinf(one.fall)).values))
        walked = recorded(
            controller, v, start, self.walks, self.accelerating.procedure, self.conditions,
            physical=True, title=name, threads=self.sweepers.threads,
        )  # fmt: skip
        save_recording(walked, self.out / "recording.nc")
        with progress_bar("rendering") as progress:
            render([walked], self.out / "gait.mp4", Film(), progress)
        return self.out / "gait.mp4"


def _summary(result: "xr.Dataset") -> dict[str, Any]:
    """The frequencies and answers of every controller, for JSON."""
    summary: dict[str, Any] = {"velocity": result.velocity.values.tolist()}
    keys = [measure + end for measure in MEASURES for end in ("", "_low", "_high")] + ["agreement", *AGREEMENT]
    for name in result.controller.values:
        one = result.sel(controller=name)
        summary[name] = {key: one[key].values.tolist() for key in keys}
    durations = {"duration": result.duration.values.tolist()}
    return summary | {"report": physical_report(result), "settings": result.attrs | durations}


def _tables(result: "xr.Dataset") -> "tuple[Table, Table]":
    """A row for each controller and velocity: the frequencies, and what the starts did."""
    frequencies = new_table("controller", "V", "t", *MEASURES)
    answers = new_table("controller", "V", "agree", "both", "only kin.", "only phys.", "none", "speed")
    for name in result.controller.values:
        for v in result.velocity.values:
            one = result.sel(controller=name, velocity=v)
            intervals = (interval(one, measure) for measure in MEASURES)
            frequencies.add_row(name, f"{v:g}", f"{one.duration.item():.0f}", *intervals)
            counts = [str(one[case].item()) for case in AGREEMENT]
            answers.add_row(name, f"{v:g}", f"{one.agreement.item():.2f}", *counts, _speeds(one))
    return frequencies, answers


def _speeds(one: "xr.Dataset") -> str:
    """Least and greatest speed of the starts that did not fall, over the commanded one."""
    speed = one.speed.values[np.isinf(one.fall.values)]
    return f"{speed.min():.2f}-{speed.max():.2f}" if np.isfinite(speed).any() else "-"
