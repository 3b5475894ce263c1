"""Draw steps in a curve and the recovery from pushes beside what is known of insects.

    python examples/insects.py

The first figure belongs to Dürr and Ebeling (2005, J. Exp. Biol. 208, 2237), the second to Revzen et al. (2013, Biol.
Cybern. 107, 179).
"""

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import hexmj
from hexmj.io import save_figure
from hexmj.legs import LEGS
from hexmj.plotting import SERIES, as_shipped, head, picture, tidy
from hexmj.tasks.task import Push, Task

WALKS = {"straight": hexmj.Command(forward=0.3), "left curve": hexmj.Command(forward=0.22, turn=0.004)}
IMPULSES = 2.0, 4.0, 8.0, 16.0, 32.0  # over mass times forward velocity; the cockroach's were 2
RECOVERY = 300.0  # of the cockroach's heading [ms]
V, VP, N_STARTS = 0.3, 80.0, 20


def steps(command: hexmj.Command) -> np.ndarray:
    """Return touch-downs and lift-offs relative to the body, (start, leg, 2, 2), means over stances [mm]."""
    walked = hexmj.physical_walk(hexmj.draw_starts(N_STARTS, seed=17), hexmj.LDVS, command, 400.0)
    feet, stance = walked.grounded, walked.grounded.stance
    xy = np.stack([feet.x + np.array(feet.geometry.origin), feet.y], axis=-1)
    ends = np.full((*stance.shape[1:], 2, 2), np.nan)
    for start, leg in np.ndindex(*stance.shape[1:]):
        if np.isinf(walked.outcomes.fall[start]):
            changes = np.diff(stance[:, start, leg].astype(int))
            for n, change in enumerate((1, -1)):
                ends[start, leg, n] = xy[np.flatnonzero(changes == change)[1:] + (change > 0), start, leg].mean(axis=0)
    return ends


def draw_steps() -> Figure:
    """Draw the mean stance of each leg, seen from above, and its length."""
    figure = picture(9.0, 5.2)
    above, lengths = figure.subplots(1, 2, width_ratios=(1, 1.6))
    found = {name: steps(command) for name, command in WALKS.items()}
    for n, (name, ends) in enumerate(found.items()):
        down, up = np.nanmean(ends, axis=0).swapaxes(0, 1)
        for leg in range(6):
            arrow = {"arrowstyle": "->", "color": SERIES[n]["color"], "linewidth": 2, "shrinkA": 0, "shrinkB": 0}
            above.annotate("", (-up[leg, 1], up[leg, 0]), (-down[leg, 1], down[leg, 0]), arrowprops=arrow)
        size = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)
        style = SERIES[n] | {"linestyle": "none", "capsize": 3, "label": name}
        lengths.errorbar(np.arange(6) + 0.2 * n - 0.1, np.nanmean(size, axis=0), np.nanstd(size, axis=0), **style)
    above.set(xlim=(-30, 30), ylim=(-46, 46), aspect="equal", xlabel="to the right of O [mm]", ylabel="ahead of O [mm]")
    lengths.set(ylim=(0, None), ylabel="length of a stance, relative to the body [mm]")
    lengths.set_xticks(range(6), LEGS)
    lengths.legend(frameon=False, loc="lower right")
    for axes in (above, lengths):
        tidy(axes)
    short, same = (np.nanmean(np.linalg.norm(np.diff(ends, axis=2), axis=-1)[:, :3]) for ends in found.values())
    finding = f"in a left curve, stances of the inner legs shorten from {short:.1f} to {same:.1f} mm"
    head(figure, finding, f"LDVS, {N_STARTS} starts of seed 17", "arrows from touch-down to lift-off")
    return figure


def pushed() -> xr.Dataset:
    """Let LDVS walk with pushes of all impulses to the left."""
    tasks = [Task(f"{i:g}", V, events=(Push(impulse=i * V),), duration=100.0) for i in IMPULSES]
    return hexmj.run_task(tasks, hexmj.LDVS, n_starts=2 * N_STARTS).isel(controller=0)


def draw_recovery(result: xr.Dataset) -> Figure:
    """Draw the time of recovery over the impulse, with the frequency of falls."""
    figure = picture(7.0, 4.6)
    axes, time = figure.subplots(), 1e3 / VP * result.recovery_each
    back = time.where(np.isfinite(time)).quantile([0.25, 0.5, 0.75], "start").values
    style = SERIES[0] | {"capsize": 3, "label": "hexmj: median and quartiles of walks that recover"}
    axes.errorbar(IMPULSES, back[1], np.abs(back[[0, 2]] - back[1]), **style)
    axes.axhline(RECOVERY, color="0.4", linestyle=":", label="cockroach: heading recovers within 300 ms")
    axes.axvline(2.0, color="0.4", linewidth=0.8)
    axes.annotate("impulse on the cockroach", (2.04, 120.0), rotation=90, fontsize=9)
    for impulse, fell, high in zip(IMPULSES, result.fell.values, back[2], strict=True):
        above = {"xytext": (0, 6), "textcoords": "offset points", "ha": "center", "fontsize": 9}
        axes.annotate(f"falls {fell:.2f}", (impulse, high), **above)
    axes.set_xscale("log", base=2)
    axes.set(xlim=(1.7, 38.0), ylim=(0, None), ylabel="time of recovery [ms]")
    axes.set_xlabel("impulse to the left / (mass x forward velocity)")
    axes.set_xticks(IMPULSES, [f"{impulse:g}" for impulse in IMPULSES])
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    tidy(axes)
    finding = f"after a push as strong as the cockroach's, LDVS recovers in {back[1, 0]:.0f} ms"
    head(figure, finding, f"{result.sizes['start']} starts of seed 17, V = {V:g}, $V_p$ = {VP:g} mm/s")
    return figure


def main() -> None:
    """Draw both figures."""
    out = Path("results/insects")
    with as_shipped():
        save_figure(draw_steps(), out / "steps.png")
        save_figure(draw_recovery(pushed()), out / "recovery.png")


if __name__ == "__main__":
    main()
