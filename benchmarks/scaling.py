"""Time of kinematic and physical FLSS against starts, velocities, threads and the observation time t.

    python -m benchmarks.scaling [--out results/bench] [--share 1.0]

It prints a table and writes the figure `scaling.png` and all measured points, `scaling.json`, in about two minutes on
two cores.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.table import description, print_table
from hexmj import LDVS, flss, physical_flss
from hexmj.files import write_text
from hexmj.io import json_text
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
CHEAP = 1.0
"""A run that takes less is repeated, and the median of three counts [s]."""


@dataclass(frozen=True)
class Work:
    """The size of one call of FLSS of LDVS."""

    starts: int
    t: float = 40.0
    """Observation time [time units]; 40 is the observation time 'start'."""
    velocity: float = 0.5
    velocities: int = 1
    """Number of velocities, 0.001 apart, so that each costs the same."""
    threads: int = thread_count()

    def seconds(self, measure: str) -> float:
        """Return the time of the call [s]."""
        velocities, times = self.velocity + 0.001 * np.arange(self.velocities), []
        while len(times) < 3 and sum(times) < CHEAP:
            begin = perf_counter()
            FLSS[measure](LDVS, velocities, n_starts=self.starts, observation_time=self.t, threads=self.threads)
            times.append(perf_counter() - begin)
        return median(times)


@dataclass(eq=False)
class Curve:
    """Time against one size; all others are those of `work`."""

    measure: str
    against: str
    work: Work
    size: list[int]
    seconds: list[float] = field(default_factory=list)

    @property
    def growth(self) -> str:
        """Exponent of time over size in the upper half of the sizes, or the speed-up by threads."""
        if self.against == "threads":
            return f"speed-up {self.seconds[0] / self.seconds[-1]:.2f}"
        half = slice(min(len(self.size) // 2, len(self.size) - 2), None)
        return f"exponent {np.polyfit(np.log(self.size[half]), np.log(self.seconds[half]), 1)[0]:.2f}"


def curves(share: float) -> Iterator[Curve]:
    """Measure the eight curves, with a share of all starts and observation times."""
    cores = thread_count()
    threads = sorted({min(2**i, cores) for i in range(cores.bit_length() + 1)})
    velocities, times, slow = (1, 2, 3, 4, 6, 9), (20, 50, 100, 200, 500, 1000, 2000), 0.1  # hardly any loss at 0.1
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
        work = replace(work, starts=max(1, round(share * work.starts)), t=max(1.0, share * work.t))
        curve = Curve(measure, against, work, list(sizes))
        curve.seconds = [replace(work, **{against: size}).seconds(measure) for size in curve.size]
        yield curve


def figure(measured: Sequence[Curve]) -> "Figure":
    """Draw time against each size: measured points, and a line of proportional time."""
    from matplotlib.figure import Figure

    result = Figure(figsize=(10.0, 5.2), layout="constrained")
    for curve, axes in zip(measured, result.subplots(2, 4, sharey="row").flat, strict=True):
        draw(curve, axes)
    return result


def draw(curve: Curve, axes: "Axes") -> None:
    """Draw one curve, with the other sizes and its growth as a title."""
    from matplotlib.ticker import NullLocator

    size, seconds, work = np.array(curve.size, dtype=float), np.array(curve.seconds), curve.work
    line = seconds[0] * size[0] / size if curve.against == "threads" else seconds[-1] * size / size[-1]
    axes.loglog(size, line, color="0.55", linewidth=0.9, label="proportional")
    axes.loglog(size, seconds, "o", color=MEASURE_STYLES[curve.measure]["color"], markersize=4.5, label="measured")
    if curve.against != "starts":
        ticks = curve.size[::3] if curve.against == "t" else curve.size
        axes.set_xticks(ticks, [f"{n:g}" for n in ticks])
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.set_ylabel(f"{curve.measure} FLSS: time [s]", fontsize=9)
        axes.legend(frameon=False, fontsize=9)
    axes.set_xlabel(LABELS[curve.against], fontsize=9)
    axes.tick_params(labelsize=9)
    axes.grid(color="0.92", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    others = {"starts": f"starts: {work.starts:,}", "t": f"t = {work.t:g}", "velocity": f"V = {work.velocity:g}"}
    shown = ", ".join(text for key, text in others.items() if key != curve.against)
    axes.set_title(f"{shown}\n{curve.growth}", fontsize=9, loc="left", color="0.25")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, draw and write."""
    parser = argparse.ArgumentParser(description="Time of FLSS against starts, velocities, threads and t.")
    parser.add_argument("--out", type=Path, default=Path("results/bench"), help="folder (default: %(default)s)")
    parser.add_argument("--share", type=float, default=1.0, help="factor of starts and times (default: %(default)s)")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    for compute in FLSS.values():
        compute(LDVS, [0.5], n_starts=600, observation_time=1.0)  # compile
    measured = list(curves(options.share))
    columns = ["FLSS", "against", "from", "to", "growth"]
    ends = [[f"{c.size[i]:,}: {c.seconds[i]:.3g} s" for i in (0, -1)] for c in measured]
    print_table(columns, [[c.measure, c.against, *e, c.growth] for c, e in zip(measured, ends, strict=True)])
    data = {"machine": description(), "share": options.share, "curves": [asdict(curve) for curve in measured]}
    write_text(options.out / "scaling.json", json_text(data) + "\n")
    figure(measured).savefig(options.out / "scaling.png", dpi=200)


if __name__ == "__main__":
    main()
