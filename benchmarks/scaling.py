"""How the time of kinematic and of physical FLSS grows with starts, velocities, threads and the observation time t.

``python -m benchmarks.scaling [--out results/bench] [--share 1.0]`` prints a table and writes the figure
``scaling.png`` and all measured points, ``scaling.json``; about a minute and a half on two cores.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from scipy.optimize import nnls

from benchmarks.processor import description
from hexmj import LDVS, Conditions, Stride, draw_starts, first_loss, flss, physical_flss
from hexmj.files import write_text
from hexmj.io import json_text, results_folder, save_figure
from hexmj.plotting import MEASURE_STYLES
from hexmj.threads import thread_count

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLSS: dict[str, Callable[..., "xr.Dataset"]] = {"kinematic": flss, "physical": physical_flss}
LABELS = {
    "starts": "number of starts",
    "velocities": "number of velocities",
    "threads": "number of threads",
    "t": "observation time t [time units]",
}
FIGURE, DATA = "scaling.png", "scaling.json"
CHEAP = 1.0
"""A run that takes less is repeated, and the median of three counts [s]."""

SOME = 10_000
"""Starts from which the mean number of steps before a loss is had."""


@dataclass(frozen=True)
class Work:
    """What one call of FLSS has to do (LDVS)."""

    starts: int
    t: float = 40.0
    """Observation time [time units]; 40 is the observation time 'start'."""
    velocity: float = 0.5
    velocities: int = 1
    """How many, 0.001 apart, so that each costs the same."""
    threads: int = thread_count()

    def scaled(self, share: float) -> "Work":
        """The same with `share` of the starts and of the observation time, at least one of each."""
        return replace(self, starts=max(1, round(share * self.starts)), t=max(1.0, share * self.t))

    def each_velocity(self) -> np.ndarray:
        """The velocities, (velocity,)."""
        return self.velocity + 0.001 * np.arange(self.velocities)


@dataclass(frozen=True, eq=False)
class Curve:
    """Time against one size, all others as in `work`."""

    measure: str
    against: str
    work: Work
    size: list[float]
    seconds: list[float]
    steps: list[float]
    """Start-steps of the network, or physics steps with those of settling, that each size took."""

    @property
    def exponent(self) -> float:
        """Slope of log time over log size in the upper half of the sizes."""
        first = max(0, min(len(self.size) // 2, len(self.size) - 2))
        if len(self.size) < 2:
            return np.nan
        return float(np.polyfit(np.log(self.size[first:]), np.log(self.seconds[first:]), 1)[0])

    @property
    def fixed_cost(self) -> float:
        """c in time = c + k size, with the least relative errors [s]; NaN where the size divides the time."""
        if self.against == "threads":
            return np.nan
        seconds = np.array(self.seconds)
        terms = np.stack([1 / seconds, np.array(self.size) / seconds], axis=1)
        return float(nnls(terms, np.ones(len(seconds)))[0][0])

    def summary(self) -> dict[str, float]:
        """What the table shows of the largest size [s], and of the growth."""
        last = self.at(self.size[-1])
        return {
            "seconds_per_start": self.seconds[-1] / (last.starts * last.velocities),
            "seconds_per_step": self.seconds[-1] / self.steps[-1],
            "core_seconds_per_step": self.seconds[-1] / self.steps[-1] * last.threads,
            "exponent": self.exponent,
            "fixed_cost": self.fixed_cost,
            "speed_up": self.seconds[0] / self.seconds[-1] if self.against == "threads" else np.nan,
        }

    def at(self, size: float) -> Work:
        """The work at one size."""
        return replace(self.work, **{self.against: size})


def curves(share: float) -> Iterator[Curve]:
    """The eight curves, with `share` of all starts and observation times."""
    cores = thread_count()
    threads = sorted({min(2**i, cores) for i in range(cores.bit_length() + 1)})
    velocities = (1, 2, 3, 4, 6, 9)
    times = (20, 50, 100, 200, 500, 1000, 2000)
    slow = 0.1  # where almost nobody loses stability, so time is used up
    for measure, against, work, sizes in (
        ("kinematic", "starts", Work(1), (1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6, 3e6, 1e7)),
        ("kinematic", "velocities", Work(64_000), velocities),
        ("kinematic", "threads", Work(320_000), threads),
        ("kinematic", "t", Work(7000, velocity=slow), times),
        ("physical", "starts", Work(1), (1, 3, 10, 30, 100, 300, 1000, 2000)),
        ("physical", "velocities", Work(40), velocities),
        ("physical", "threads", Work(200), threads),
        ("physical", "t", Work(12, velocity=slow), times),
    ):
        if against in ("starts", "t"):
            sizes = np.unique(np.maximum(1, np.round(share * np.array(sizes)))).astype(int).tolist()
        yield measured(Curve(measure, against, work.scaled(share), list(sizes), [], []))


def measured(curve: Curve) -> Curve:
    """The curve with its times and steps."""
    points = [timed(curve.measure, curve.at(size)) for size in curve.size]
    return replace(curve, seconds=[s for s, _ in points], steps=[n for _, n in points])


def timed(measure: str, work: Work) -> tuple[float, float]:
    """Time of one call of FLSS, the median of three where that is cheap [s], and the steps it takes."""
    seconds = []
    while True:
        begin = perf_counter()
        result = FLSS[measure](LDVS, work.each_velocity(), n_starts=work.starts, observation_time=work.t, threads=work.threads)
        seconds.append(perf_counter() - begin)
        if len(seconds) == 3 or seconds[0] > CHEAP:
            return median(seconds), kinematic_steps(work) if measure == "kinematic" else physical_steps(work, result)


def kinematic_steps(work: Work) -> float:
    """Start-steps of the network up to the losses or the end, from the mean over some of the starts."""
    some = draw_starts(min(work.starts, SOME), 0)
    walked = [np.minimum(first_loss(some, LDVS, v, work.t), work.t).mean() for v in work.each_velocity()]
    return work.starts * float(np.sum(walked)) / Stride().dt


def physical_steps(work: Work, result: "xr.Dataset") -> float:
    """Physics steps while the starts settle, and up to the falls or the end."""
    conditions, stride = Conditions(), Stride()
    walked = np.minimum(result.fall, work.t).values.sum() / stride.dt * conditions.substeps(stride)
    settling = conditions.settling_time / 1000.0
    return float(walked + work.starts * round(settling / conditions.timestep(stride)))


def table(all_curves: Sequence[Curve]) -> Table:
    """One row for each curve."""
    result = Table(
        box=SIMPLE_HEAD,
        pad_edge=False,
        caption="per start, per step: at the largest size; exponent: over the upper half of the sizes",
    )
    for column in ("FLSS", "against", "from", "to", "per start", "per step", "exponent", "fixed cost", "speed-up"):
        result.add_column(column, justify="left" if column in ("FLSS", "against") else "right", no_wrap=True)
    for curve in all_curves:
        s = curve.summary()
        visible = s["fixed_cost"] > 0.2 * curve.seconds[0]
        result.add_row(
            curve.measure,
            curve.against,
            *(f"{curve.size[i]:,.0f}: {prefixed(curve.seconds[i])}" for i in (0, -1)),
            prefixed(s["seconds_per_start"]),
            prefixed(s["seconds_per_step"]),
            f"{s['exponent']:.2f}",
            prefixed(s["fixed_cost"]) if visible else "",
            f"{s['speed_up']:.2f}" if curve.against == "threads" else "",
        )
    return result


def prefixed(seconds: float) -> str:
    """A time with three digits and a prefixed unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def figure(all_curves: Sequence[Curve]) -> "Figure":
    """Time against each size: measured points, and a line on which time is proportional to the size."""
    from matplotlib.figure import Figure

    result = Figure(figsize=(9.0, 4.8), layout="constrained")
    panels = dict(zip(all_curves, result.subplots(2, 4, sharey="row").flat, strict=True))
    for curve, axes in panels.items():
        draw(curve, axes)
        if curve.against == "starts":
            seconds = [s for other in all_curves if other.measure == curve.measure for s in other.seconds]
            axes.set_ylim(min(seconds) / 2, max(seconds) * 2)
            axes.set_ylabel(f"{curve.measure} FLSS: time [s]", fontsize=9)
            axes.legend(frameon=False, fontsize=8, loc="upper left", handlelength=1.2)
    return result


def draw(curve: Curve, axes: "Axes") -> None:
    """One curve, with what stayed the same and its exponent or speed-up."""
    from matplotlib.ticker import LogLocator, NullLocator

    size, seconds, threads = np.array(curve.size, dtype=float), np.array(curve.seconds), curve.against == "threads"
    line = seconds[0] * size[0] / size if threads else seconds[-1] * size / size[-1]
    axes.loglog(size, line, color="0.55", linewidth=0.9, label="proportional")
    axes.loglog(size, seconds, "o", color=MEASURE_STYLES[curve.measure], markersize=4.5, label="measured")
    if curve.against == "starts":
        axes.xaxis.set_major_locator(LogLocator(numticks=5))
    else:
        ticks = curve.size[::3] if curve.against == "t" else curve.size
        axes.set_xticks(ticks, [f"{n:g}" for n in ticks])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.margins(x=0.12)
    axes.set_xlabel(LABELS[curve.against], fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(color="0.92", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    same = {
        "starts": f"{curve.work.starts:,} start{'s' if curve.work.starts > 1 else ''}",
        "t": f"t = {curve.work.t:g}",
        "velocity": f"V = {curve.work.velocity:g}",
    }
    shown = ", ".join(text for key, text in same.items() if key != curve.against)
    found = f"speed-up {seconds[0] / seconds[-1]:.2f}" if threads else f"exponent {curve.exponent:.2f}"
    axes.set_title(f"{shown}\n{found}", fontsize=8, loc="left", color="0.25")


def warm_up() -> None:
    """Compile, load and start all that is not to be measured."""
    for measure in FLSS.values():
        measure(LDVS, [0.5], n_starts=600, observation_time=1.0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, draw and write."""
    parser = argparse.ArgumentParser(description="Time of FLSS against starts, velocities, threads and t.")
    parser.add_argument("--out", type=Path, default=Path("results/bench"), help="folder (default: %(default)s)")
    parser.add_argument("--share", type=float, default=1.0, help="multiplies starts and times (default: %(default)s)")
    options = parser.parse_args(arguments)
    if not 0 < options.share <= 10:
        parser.error(f"share = {options.share}; expected above 0 and at most 10")
    folder = results_folder(options.out, (FIGURE, DATA))
    console = Console()
    console.width = max(console.width, 120)  # or the table is cut off
    warm_up()
    all_curves = []
    for curve in curves(options.share):
        console.print(f"{curve.measure} FLSS against {curve.against}: {len(curve.size)} sizes", style="dim")
        all_curves.append(curve)
    console.print(table(all_curves))
    points = [asdict(curve) | curve.summary() for curve in all_curves]
    text = json_text({"machine": description(), "share": options.share, "controller": LDVS.name, "curves": points})
    write_text(folder / DATA, text + "\n")
    save_figure(figure(all_curves), folder / FIGURE, dpi=200)
    console.print(f"{folder / FIGURE}, {folder / DATA}")


if __name__ == "__main__":
    main()
