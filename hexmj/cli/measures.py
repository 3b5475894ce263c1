"""`hexmj walk`, `hexmj flss` and `hexmj compare`."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from hexmj.cli.command import STUDY, Answer, Command, StudyCommand, draw
from hexmj.cli.options import Figures, Output, Planning, Threads, build, check_kinematic, controller
from hexmj.cli.output import four_digits, grid, report_line, table
from hexmj.errors import InputError
from hexmj.measures.tables import Measure

if TYPE_CHECKING:
    import xarray as xr


FOOT_PATH = ("vp", "step_height", "standing_height", "lift_time", "landing_time")
"""Conditions that also change the recording of a kinematic walk."""

DYNAMIC = ("vp", "standing_height")
"""Conditions that also change the dynamic measure."""

AGREE = """\
agree: fraction of starts with both a kinematic loss and a fall, or neither; dynamic: with a dynamic loss instead
both, only kinematic, only physical, none: starts with both a kinematic loss and a fall, one of them, or neither"""

FREQUENCIES = {"kinematic": "kinematic FLSS", "dynamic": "FLDS", "physical": "frequency of falls"}
"""Measure of `hexmj flss` -> name of its frequency."""


@dataclass(frozen=True)
class WalkOptions:
    """Options of `hexmj walk` that `Start` does not have."""

    physical: bool = False
    """Simulate the insect in MuJoCo. Without this option, the walk is kinematic and the recording shows the plan."""


class Walk(Command):
    """Compute one kinematic or physical walk. Write a recording (NetCDF) and a figure with the footfall diagram and the
    stability margin."""

    sources = (WalkOptions, "replay.recording:Start", Output, Planning, Threads, Figures)
    examples = ("--velocity 0.5", "--controller wilson --physical --seed 7 --json")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.replay.recording import Start, recording_summary, save_recording

        if not given.physical:
            check_kinematic(given, FOOT_PATH)
        start, out = build(Start, given), given.out
        title = f"{start.controller.name}, V = {given.velocity:g}"
        walked = start.recorded(given.physical, title, given.threads)
        settings = start.settings(**{given.controller: start.controller}) | {"physical": given.physical}
        files = [save_recording(walked, out / "recording.nc"), draw(walked, out / f"walk.{given.format}")]
        summary = recording_summary(walked)
        about = [walked[name].attrs for name in summary]
        numbers = ["none" if value == float("inf") else four_digits(value) for value in summary.values()]
        rows = [(name, n, a["units"], a["long_name"]) for name, n, a in zip(summary, numbers, about, strict=True)]
        lines = [title, table(("outcome", "value", "unit", "meaning"), rows, None)]
        lines += [f"Next: hexmj {command} {files[0]}" for command in ("render", "page", "view")]
        return Answer(summary | {"settings": settings}, lines, files, settings)


@dataclass(frozen=True)
class FlssOptions:
    """Options of `hexmj flss` that its study does not have."""

    n_starts: int | None = None
    """Number of random starts; by default 7000 (seven samples of 1000, as in the paper), or 200 in physical walks."""
    out: Path | None = None
    """Folder for figure, NetCDF, manifest and cached results; by default nothing is saved."""
    measure: Measure = "kinematic"
    """Count losses of the planned static stability (kinematic), of the planned dynamic stability (dynamic), or falls of
    the insect in MuJoCo (physical)."""
    precision: float | None = None
    """Half width of the 95 % interval of falls that is enough, such as 0.03, with --measure physical: 20,000 starts are
    planned, and as many walk as the interval needs. By default, all of --starts walk."""


class Flss(StudyCommand):
    """Measure the frequency with which a controller loses static stability (FLSS), loses dynamic stability (FLDS) or
    falls, at one or more velocities. Without --out, nothing is saved; with it, repeat the command to resume a stopped
    run."""

    study = "measures.kinematic:KinematicFlss"
    sources = (FlssOptions, study, *STUDY)
    defaults = {"out": None}  # noqa: RUF012
    data = "flss.nc"
    figures = {"flss": "flss"}  # noqa: RUF012
    examples = ("--velocity 0.5", "--measure physical --starts 50 --out results/flss")

    def build(self, given: SimpleNamespace) -> Any:
        if given.measure != "physical":
            if given.precision is not None:
                raise InputError(f"--precision = {given.precision:g} needs --measure physical")
            check_kinematic(given, DYNAMIC if given.measure == "dynamic" else ())
            return super().build(given)
        from hexmj.measures.compare import PhysicalFlss

        planned = controller(given, given.controller)
        return build(PhysicalFlss, given, controllers={planned.name: planned})

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        from hexmj.measures.compare import physical_report

        return super().summary(result) | ({"report": physical_report(result)} if "fall" in result else {})

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.measures.compare import physical_report

        columns = [
            str(name) for name, values in result.items() if values.dims == ("velocity",) and values.notnull().any()
        ]
        measure = getattr(study, "measure", "physical")
        yield FREQUENCIES[measure]
        yield grid(result, ("velocity",), columns)
        yield "low, high: 95 % interval; duration: observation time [time units]"
        if measure == "physical":
            yield report_line(physical_report(result))


class Compare(StudyCommand):
    """Compare how often controllers lose static and dynamic stability, in the plan and in the simulation, and fall, on
    the same starts. Write a table, a figure, NetCDF and a manifest. Several values of a condition, as in `--vp 40 80`,
    are an axis of the result. Repeat the command to resume a stopped run."""

    study = "measures.compare:Comparison"
    sources = (study, *STUDY)
    defaults = {"controller": ("ldvs", "uncoordinated")}  # noqa: RUF012
    data = "comparison.nc"
    figures = {"comparison": "comparison"}  # noqa: RUF012
    examples = ("--precision 0.05", "--controller hws wilson --velocity 0.5 --starts 20")

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        from hexmj.measures.compare import physical_report

        return super().summary(result) | {"report": physical_report(result)}

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.measures.compare import AGREEMENT, MEASURES, physical_report
        from hexmj.measures.figures import axes_of
        from hexmj.plotting import MEASURE_STYLES

        axes = ("controller", *axes_of(result), "velocity")
        counts = [name for name in (*AGREEMENT, "walks") if name in result]
        yield "Frequency of losses of stability and of falls, with 95 % intervals"
        yield grid(result, axes, ("duration", *MEASURES))
        yield "; ".join(style["label"] for style in MEASURE_STYLES.values())
        yield grid(result, axes, ("agreement", "dynamic_agreement", *counts))
        if study.precision is None:
            yield AGREE
        yield report_line(physical_report(result))
