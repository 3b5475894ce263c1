"""What each mechanism or rule buys, as a figure: a row for each controller, a panel for each measure."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.literal import in_figure
from hexmj.measures.captions import caption
from hexmj.studies.ablation.study import MEASURES
from hexmj.studies.league.study import REGIMES

if TYPE_CHECKING:
    import xarray as xr

    from hexmj.pictures import Picture


def ablation_figure(result: "xr.Dataset") -> "Picture":
    """Frequencies of the whole, and below it how much more often it happens without a part, from `Ablation`."""
    from hexmj.pictures import head, picture

    rows, velocities = result.sizes["controller"], [f"{v:g}" for v in result.velocity.values]
    figure = picture(3.6 + 2.5 * len(MEASURES), 1.8 + 0.42 * rows)
    panels = figure.subplots(1, len(MEASURES), sharey=True)
    wholes = result.controller.values == result.whole.values
    for panel, (measure, title) in zip(panels, MEASURES.items(), strict=True):
        one = result.sel(measure=measure)
        shown = np.where(wholes[:, None], np.nan, one.more.values)
        panel.imshow(shown, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
        for row, column in np.ndindex(shown.shape):
            text, weight = f"{one.frequency.values[row, column]:.2f}", "bold"
            if not wholes[row]:
                sure = one.more_low.values[row, column] > 0 or one.more_high.values[row, column] < 0
                text, weight = f"{np.round(shown[row, column], 2) + 0.0:+.2f}", "bold" if sure else "normal"
            colour = "white" if abs(np.nan_to_num(shown[row, column])) > 0.6 else "0.1" if weight == "bold" else "0.5"
            panel.text(
                column,
                row,
                text.replace("-", "\N{MINUS SIGN}"),
                ha="center",
                va="center",
                fontsize=8,
                color=colour,
                fontweight=weight,
            )
        panel.set_title(f"{measure}\n{title}", fontsize=9)
        panel.set_xticks(range(len(velocities)), velocities)
        panel.set_xlabel("velocity $V_r / V_p$", fontsize=9)
        panel.tick_params(length=0)
        panel.spines[:].set_visible(False)
        for row in np.flatnonzero(wholes)[1:]:
            panel.axhline(row - 0.5, color="0.3", linewidth=0.8)
    panels[0].set_yticks(range(rows), [in_figure(name) for name in result.controller.values])
    counts = f"{result.attrs['n_starts']} starts, {result.attrs['n_physical']} in physics, {REGIMES} for the limit"
    heading = "What a part buys: frequencies of the whole, and differences without it (bold: 95 % interval excludes 0)"
    head(figure, heading, f"{counts}; {caption(result)}")
    return figure
