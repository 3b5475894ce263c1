"""What each mechanism or rule buys, as a figure: a row for each controller, a panel for each measure."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.measures.captions import caption, starts_in_words
from hexmj.pictures import in_figure
from hexmj.studies.ablation.study import MEASURES
from hexmj.studies.league.study import REGIMES

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.pictures import Picture

NONE, FEWER = "\N{EN DASH}", "\N{BULLET}"
"""Where no walk is left, and beside a number of which some are missing."""

NOTES = {NONE: "no walk is left", FEWER: "walks are missing that diverged or were out of reach"}


def ablation_figure(result: "xr.Dataset") -> "Picture":
    """Frequencies of the whole, and below it how much more often it happens without a part, from `Ablation`."""
    from hexmj.pictures import head, picture

    rows, velocities = result.sizes["controller"], [f"{v:g}" for v in result.velocity.values]
    figure = picture(2.6 + 0.58 * len(MEASURES) * max(4, len(velocities)), 1.9 + 0.27 * rows)
    panels, used = figure.subplots(1, len(MEASURES), sharey=True), set[str]()
    wholes = result.controller.values == result.whole.values
    for panel, (measure, title) in zip(panels, MEASURES.items(), strict=True):
        one = result.sel(measure=measure).transpose("controller", "velocity", ...)
        shown = np.where(wholes[:, None], np.nan, one.more.values)
        panel.imshow(shown, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
        for row, column in np.ndindex(shown.shape):
            text, sure = written(one.isel(controller=row, velocity=column))
            used |= {*text} & {*NOTES}
            depth = abs(np.nan_to_num(shown[row, column]))  # of the colour behind it
            colour = "white" if depth > 0.6 else "0.1" if sure or depth > 0.2 else "0.5"
            style = {"ha": "center", "va": "center", "fontsize": 8, "color": colour}
            panel.text(column, row, text, **style, fontweight="bold" if sure else "normal")
        panel.set_title(f"{measure}\n{title}", fontsize=9)
        panel.set_xticks(range(len(velocities)), velocities)
        panel.set_xlabel("velocity $V_r / V_p$", fontsize=9)
        panel.tick_params(length=0)
        panel.spines[:].set_visible(False)
        for row in np.flatnonzero(result.whole.values[1:] != result.whole.values[:-1]):
            panel.axhline(row + 0.5, color="0.3", linewidth=0.8)
    panels[0].set_yticks(range(rows), [in_figure(name) for name in result.controller.values])
    starts = result.attrs["n_starts"]
    counts = f"{starts_in_words(starts)}, {result.attrs['n_physical']} in physics, {min(starts, REGIMES)} for the limit"
    heading = "What a part buys: frequencies of the whole, and differences without it (bold: 95 % interval excludes 0)"
    head(figure, heading, f"{counts}; {caption(result)}")
    if used:
        figure.supxlabel("; ".join(f"{mark} {note}" for mark, note in NOTES.items() if mark in used), fontsize=8)
    return figure


def written(one: "xr.Dataset") -> tuple[str, bool]:
    """What stands in a cell, of one controller, measure and velocity, and whether it stands out."""
    whole = one.controller.item() == one.whole.item()
    value = (one.frequency if whole else one.more).item()
    if np.isnan(value):
        return NONE, False
    text = f"{value:.2f}" if whole else f"{np.round(value, 2) + 0.0:+.2f}".replace("-", "\N{MINUS SIGN}")
    fewer = one.measure.item() == "physical" and one.frequency_starts.item() < one.attrs["n_physical"]
    sure = whole or one.more_low.item() > 0 or one.more_high.item() < 0
    return text + (FEWER if fewer else ""), sure
