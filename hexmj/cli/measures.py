"""`hexmj walk`, `hexmj flss` and `hexmj compare`."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.cli.command import Answer, Command, StudyCommand, at_work, draw, filmed
from hexmj.cli.options import (
    Figures,
    Output,
    Planning,
    Threads,
    Workers,
    acceleration,
    build,
    conditions,
    controller,
    no_effect,
    stride,
)
from hexmj.cli.output import (
    Column,
    four_digits,
    grid,
    report_line,
    table,
)
from hexmj.conditions import Conditions
from hexmj.controllers.protocol import Controller
from hexmj.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


PHYSICAL = tuple(member.name for member in fields(Conditions) if member.name != "body")
"""Conditions, in the order of their fields."""

FOOT_PATH = ("vp", "step_height", "standing_height", "lift_time", "landing_time")
"""Conditions that a recording of a plan shows as well."""

TIMES = ("planned loss", "measured loss", "fall")
"""Events of a walk, which may not happen."""


@dataclass(frozen=True)
class WalkOptions:
    """Options of one walk."""

    physical: bool = False
    """Walk the insect in MuJoCo; otherwise the recording shows the plan."""
    out: Path = Path("results/walk")
    """Folder for the recording, the figure and the manifest."""


class Walk(Command):
    """Walk once, kinematically or physically, and write a recording (NetCDF) and a figure with the footfall diagram
    and the stability margin."""

    sources = (WalkOptions, "replay.recording:Start", Output, Planning, Threads, Figures)
    examples = ("--velocity 0.5", "--controller wilson --physical --seed 7 --json")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.io import attributes, results_folder
        from hexmj.replay.recording import Start, recording_summary, save_recording

        if not given.physical:
            no_effect(given, [*(set(PHYSICAL) - {*FOOT_PATH}), "feedback"], "without --physical")
        start, out = build(Start, given), results_folder(given.out)
        title = f"{start.controller.name}, V = {given.velocity:g}"
        walked = start.recorded(given.physical, title, given.threads)
        settings = start.settings(**{given.controller: start.controller}) | {"physical": given.physical}
        files = [save_recording(walked, out / "recording.nc"), draw(walked, out / f"walk.{given.format}")]
        summary = recording_summary(walked)
        lines = [f"{key}: {_in_words(key, value)}" for key, value in summary.items() if value is not None]
        made = walked.drop_vars(walked.variables).assign_attrs(attributes(settings))
        return Answer(summary | {"settings": settings}, [title, *lines], files, result=made)


@dataclass(frozen=True)
class FlssOptions:
    """Options of FLSS."""

    controller: Controller
    velocities: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Velocities V_r as fractions of V_p, 0 <= V < 1; when accelerating, the final ones."""
    n_starts: int | None = None
    """Number of random starts; by default 7000 (seven samples of 1000, as in the paper), or 200 with --physical."""
    out: Path | None = None
    """Folder for figure, NetCDF, manifest and cached results; by default nothing is written."""
    physical: bool = False
    """Count falls of the insect in MuJoCo instead of losses of the planned stability."""
    range_of: int | None = None
    """Starts that are computed and cached as one cell, by default 1600000; no result depends on it."""
    conditions: Conditions = Conditions()


class Flss(Command):
    """Measure the FLSS of a controller over velocities, kinematic or physical. A run with --out that was stopped
    resumes if it is repeated."""

    sources = (FlssOptions, "measures.kinematic:KinematicFlss", Output, Planning, Workers, Figures)
    examples = ("--velocity 0.5", "--physical --velocity 0.3 0.5 --starts 50 --out results/flss")

    def run(self, given: SimpleNamespace) -> Answer:
        from hexmj.io import attributes, results_folder, save
        from hexmj.measures.compare import physical_report

        if not given.physical:
            no_effect(given, [*PHYSICAL, "feedback"], "without --physical")
        elif given.range_of is not None:
            raise InputError(f"--range-of = {given.range_of} has no effect with --physical")
        if given.out:
            results_folder(given.out)
        result = self.measured(given).assign_attrs(attributes({"model": given.controller, "physical": given.physical}))
        files: list[Path] = []
        if given.out:
            files = [save(result, given.out / "flss.nc"), draw(result, given.out / f"flss.{given.format}")]
        names = [str(name) for name, values in result.items() if values.dims == ("velocity",)]
        report = physical_report(result) if given.physical else {}
        lists = {name: result[name].values.tolist() for name in ["velocity", *names]}
        columns = [name for name in names if result[name].notnull().any()]
        rows = [
            (f"{v:g}", *(four_digits(result[name].sel(velocity=v).item()) for name in columns))
            for v in result.velocity.values
        ]
        lines = [f"{'physical' if given.physical else 'kinematic'} FLSS of {given.controller}"]
        lines += [table(("V", *columns), rows), *([report_line(report)] if report else [])]
        return Answer(lists | ({"report": report} if report else {}), lines, files, result=result)

    def measured(self, given: SimpleNamespace) -> "xr.Dataset":
        """Return the FLSS over velocities."""
        from hexmj.measures.kinematic import RANGE, flss

        walks: Any = {name: getattr(given, name) for name in ("observation_time", "seed")}
        walks |= {"stride": stride(given), "acceleration": acceleration(given)}
        planned, folder = controller(given, given.controller), given.out and given.out / "walks"
        with at_work(given, f"{'physical' if given.physical else 'kinematic'} FLSS") as execution:
            how: Any = walks | execution | {"folder": folder}
            if given.physical:
                from hexmj.measures.compare import physical_flss

                n_starts = 200 if given.starts is None else given.starts
                return physical_flss(planned, given.velocity, n_starts=n_starts, conditions=conditions(given), **how)
            how |= {} if given.starts is None else {"n_starts": given.starts}
            return flss(planned, given.velocity, range_of=RANGE if given.range_of is None else given.range_of, **how)


@dataclass(frozen=True)
class CompareOptions:
    """Options of a comparison."""

    no_video: bool = False
    """Leave the video out."""


class Compare(StudyCommand):
    """Compare the kinematic, measured and physical FLSS of controllers on the same starts: table, figure, NetCDF,
    manifest and a gait video. A run that was stopped resumes if it is repeated."""

    study = "measures.compare:Comparison"
    own = (CompareOptions,)
    usual = {"controller": ("ldvs", "uncoordinated")}  # noqa: RUF012
    data = "comparison.nc"
    figures = {"comparison": "comparison"}  # noqa: RUF012
    examples = ("", "--controller hws wilson --velocity 0.5 --starts 20 --no-video")

    def others(self, given: SimpleNamespace, result: "xr.Dataset") -> list[Path]:
        """Write a recording of the first controller near V = 0.3, from a start that stays stable, and its video."""
        from hexmj.replay.recording import Start, save_recording

        if given.no_video:
            return []
        name, velocities = str(result.controller.values[0]), result.velocity.values
        v = float(velocities[np.abs(velocities - 0.3).argmin()])
        data = result.sel(controller=name, velocity=v)
        start = int(np.argmax((np.isinf(data.planned_loss) & np.isinf(data.fall)).values))
        first = build(Start, given, controller=controller(given, given.controller[0]), velocity=v, start=start)
        walked = first.recorded(True, name, given.threads)
        return [save_recording(walked, given.out / "recording.nc"), *filmed(given.out / "gait.mp4", [walked])]

    def summary(self, result: "xr.Dataset") -> dict[str, Any]:
        from hexmj.io import settings
        from hexmj.measures.compare import AGREEMENT, BESIDE, MEASURES, physical_report

        summary: dict[str, Any] = {"velocity": result.velocity.values.tolist()}
        keys = [measure + end for measure in MEASURES | BESIDE for end in ("", "_low", "_high")]
        for name in result.controller.values:
            data = result.sel(controller=name)
            summary[name] = {key: data[key].values.tolist() for key in [*keys, "agreement", *AGREEMENT]}
        durations = {"duration": result.duration.values.tolist()}
        return summary | {"report": physical_report(result), "settings": settings(result) | durations}

    def shown(self, study: Any, result: "xr.Dataset") -> Iterable[Any]:
        from hexmj.measures.compare import AGREEMENT, BESIDE, MEASURES, physical_report

        axes, names = ("controller", "velocity"), ("both", "kin.", "phys.", "none")
        columns: dict[str, Column] = {"t": lambda data: four_digits(data.duration.item())}
        counts = {heading: _count(name) for heading, name in zip(names, AGREEMENT, strict=True)}
        answers = {"agree": "agreement", **counts, **{name: name for name in BESIDE}}
        yield "Frequency of the loss of static stability, with 95 % intervals; physical: falls"
        yield grid(result, axes, columns | {name: name for name in MEASURES})
        yield (
            "Starts that lost the planned stability and fell (both), did either (kin., phys.) or none; speed over the"
            " commanded one, least to greatest of the starts that did not fall"
        )
        yield grid(result, axes, answers | {"speed": _speeds})
        yield report_line(physical_report(result))


def _count(name: str) -> Column:
    return lambda data: f"{data[name].item()}"


def _speeds(data: "xr.Dataset") -> str:
    """Return the least and the greatest speed of the starts that did not fall, over the commanded one."""
    speed = data.speed.values[np.isinf(data.fall.values)]
    return f"{speed.min():.2f}-{speed.max():.2f}" if np.isfinite(speed).any() else "-"


def _in_words(key: str, value: Any) -> str:
    """Return a number of a walk as text; an event may not happen."""
    if key in TIMES:
        return f"at {four_digits(value)} time units" if math.isfinite(value) else "none within the walk"
    return str(value) if not isinstance(value, float) else "-" if math.isnan(value) else four_digits(value)
