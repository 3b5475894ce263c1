"""Draw the figures of the concept pages into `docs/images`: `.venv/bin/python docs/concept_figures.py`."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hexmj
from hexmj.legs import LEGS
from hexmj.plotting import MEASURE_STYLES, SERIES
from hexmj.walks import spans

BLUE, RED = (MEASURE_STYLES[measure]["color"] for measure in ("kinematic", "physical"))
TEAL, PINK, BROWN, *_ = COLORS = [style["color"] for style in SERIES]
GREY, BOLD, STRIDE = "0.45", {"weight": "bold", "va": "center", "ha": "center"}, hexmj.Stride()
STYLE = {"font.size": 12, "axes.titlesize": 13, "axes.spines.top": False, "axes.spines.right": False}
STYLE |= {"legend.frameon": False, "figure.constrained_layout.use": True, "savefig.dpi": 110}


def seen_from_above(axes: Axes, title: str) -> None:
    """Draw the trunk, forward up and left on the left, below a title."""
    axes.fill([0, 2.5, 2.5, 1, -1, -2.5, -2.5], [31, 26, -20, -46, -46, -20, 26], color="0.9", zorder=0)
    axes.set(xlim=(-31, 31), ylim=(-46, 47), aspect="equal", title=title)
    axes.axis("off")


def arrow(axes: Axes, tail: tuple[float, float], tip: tuple[float, float], number: int, style: str = "-|>") -> None:
    """Draw an arrow with the number and the colour of a mechanism."""
    color, (x, y) = COLORS[number - 1], np.mean([tail, tip], axis=0)
    axes.annotate("", tip, tail, arrowprops={"arrowstyle": style, "color": color, "lw": 2, "mutation_scale": 15})
    axes.text(x, y, str(number), color=color, bbox={"color": "white", "pad": 1.2}, **BOLD)


def network(figure: Figure) -> None:
    """Draw the axes of the six legs with their positions and distances, and the couplings of the mechanisms."""
    left, right = figure.subplots(1, 2)
    seen_from_above(left, "axes of the legs, seen from above")
    for name, y, ahead in zip(LEGS, STRIDE.geometry.y, STRIDE.geometry.origin, strict=True):
        left.vlines(-y, ahead - 20, ahead - 10, colors=GREY, linestyles=":")
        left.vlines(-y, ahead - 10, ahead + 10, colors=TEAL, linewidth=3)
        left.hlines([ahead + 10, ahead - 10, ahead - 20], -y - 2, -y + 2, colors=[PINK, BROWN, GREY], linewidth=3)
        left.plot([0, -y], [ahead, ahead], "o-", color=GREY, linewidth=0.8, markevery=[1], markersize=6)
        left.text(-y - 5.5 * np.sign(y), ahead, name, fontsize=14, **BOLD)
        distance = f"{y:g}" if y > 0 else f"{ahead:+g}".replace("-", "\N{MINUS SIGN}")
        left.text(-8.2 * np.sign(y), ahead + 0.7, f"{distance} mm", ha="center", fontsize=11)
    for x, y, name, color in ((-21, 38, "AEP$_0$", PINK), (-21, 18, "PEP$_0$", BROWN), (-18, -40, "PEP$_{min}$", GREY)):
        left.text(x, y, name, color=color, ha="right", va="center")
    left.plot(0, 0, "kP", markersize=10)
    left.text(2.8, -3, "centre\nof mass", fontsize=11, va="center")
    left.annotate("forward", (0, 46), (0, 33), ha="center", fontsize=11, arrowprops={"arrowstyle": "-|>", "lw": 2})
    seen_from_above(right, "mechanisms 1 to 4, from sender to receiver")
    for leg, name in enumerate(LEGS):
        x, y = (-18.0, 18.0)[leg // 3], 32.0 * (1 - leg % 3)
        right.text(x, y, name, fontsize=14, bbox={"boxstyle": "circle", "fc": "white", "ec": GREY}, **BOLD)
        if leg % 3 < 2:
            for shift, up, down in ((-6, 1, 4), (-2, 2, 3)):
                arrow(right, (x + shift, y - 25), (x + shift, y - 7), up)
                arrow(right, (x - shift, y - 7), (x - shift, y - 25), down)
        if leg < 3:
            arrow(right, (-12, y + 2.3), (12, y + 2.3), 1, "<|-|>")
            arrow(right, (-12, y - 2.3), (12, y - 2.3), 3, "<|-|>")


def third_mechanism(figure: Figure) -> None:
    """Draw how mechanism 3 shifts the PEP of the leg behind, over the position of its sender (Eq. 4)."""
    axes, x = figure.subplots(), np.linspace(-10, 10, 801)
    curves = [("HWS, any V", hexmj.HWS, 0.5), ("LDVS, V = 0.1", hexmj.LDVS, 0.1), ("LDVS, V = 0.9", hexmj.LDVS, 0.9)]
    for (name, preset, velocity), color, line in zip(curves, COLORS, ("-", "--", "-."), strict=False):
        p, neutral = preset.weights, preset.weights.p31_i + preset.weights.p34_i * velocity
        shift = np.minimum(np.where(x <= neutral, p.p32_i, p.p33_i) * (neutral - x), 4.0)
        axes.plot(x, shift, color=color, linestyle=line, linewidth=2.5, label=name)
        axes.plot(neutral, 0, "o", color=color, markersize=9)
    axes.text(-2.1, 0.15, "neutral position")
    axes.axhline(0, color=GREY, linewidth=0.8)
    axes.set(xlabel="position of the sender [mm]; stance moves it to the left", ylabel="shift of the PEP [mm]")
    axes.legend(loc="upper right")


def footfalls(figure: Figure) -> None:
    """Draw steady-state footfall patterns of HWS and LDVS over two periods of an uncoupled leg."""
    panels = [(preset, velocity) for preset in (hexmj.HWS, hexmj.LDVS) for velocity in (0.1, 0.9)]
    for axes, (preset, velocity) in zip(figure.subplots(2, 2, sharey=True).ravel(), panels, strict=True):
        period, slow = STRIDE.periods(velocity), hexmj.Acceleration()
        duration = 60 * period + slow.duration(velocity)
        walk = hexmj.walk(hexmj.draw_starts(2, 1)[1:], preset, velocity, duration, acceleration=slow)
        last = walk.time > walk.time[-1] - 2 * period
        for leg in range(6):
            bars = spans((walk.time[last] - walk.time[last][0]) / period, ~walk.stance[last, 0, leg])
            axes.broken_barh(bars, (5.15 - leg, 0.7), color=TEAL if leg < 3 else BROWN)
        axes.set(xlim=(0, 2), ylim=(0, 6), xticks=[0, 0.5, 1, 1.5, 2], title=f"{preset.name.upper()}, V = {velocity}")
        axes.set_yticks(np.arange(5.5, 0, -1), LEGS)
    figure.supxlabel("time [periods of an uncoupled leg]; bars: leg in swing", fontsize=12)


def stability(figure: Figure) -> None:
    """Draw two moments of a walk, centre of mass inside and outside of the support polygon, and the margin."""
    walk = hexmj.walk(hexmj.draw_starts(8, 0)[7:], hexmj.LDVS, 0.5, 60.0)
    margin, panels = hexmj.walk_margin(walk)[:, 0], figure.subplot_mosaic("AB;CC", height_ratios=[2.2, 1])
    below, moments = panels["C"], {"A": ("inside", 299, BLUE), "B": ("outside", int(np.argmin(margin)), RED)}
    for panel, (name, step, color) in moments.items():
        above, feet, stands = panels[panel], walk.feet[step, 0], walk.stance[step, 0]
        seen_from_above(above, f"{name}: margin {margin[step]:+.1f} mm".replace("-", "\N{MINUS SIGN}"))
        above.fill(*(hexmj.support_polygon(feet, stands).T[::-1] * [[-1], [1]]), color=color, alpha=0.25)
        above.plot(-feet[stands, 1], feet[stands, 0], "ko", markersize=9, label="foot in stance")
        above.plot(-feet[~stands, 1], feet[~stands, 0], "ko", markersize=9, fillstyle="none", label="foot in swing")
        above.plot(0, 0, "P", color=color, markersize=13, label="centre of mass")
        below.plot(walk.time[step], margin[step], "P", color=color, markersize=13, zorder=3)
    panels["A"].legend(fontsize=11, loc="lower left", bbox_to_anchor=(-0.62, 0.0))
    below.plot(walk.time, margin, color="black")
    below.axhline(0, color=GREY, linewidth=0.8)
    below.fill_between(walk.time, margin, 0, where=margin <= 0, color=RED, alpha=0.4)
    below.set(xlabel="time [time units]", ylabel="margin [mm]")


if __name__ == "__main__":
    with mpl.rc_context(mpl.rcParamsDefault | STYLE):
        for draw, size in {network: (9, 6), third_mechanism: (8, 4), footfalls: (9, 4.4), stability: (9, 6.6)}.items():
            draw(figure := Figure(figsize=size))
            figure.savefig(Path(__file__).parent / "images" / f"{draw.__name__}.png")
