"""The comparison of readings as a figure: what each choice changes."""

from typing import TYPE_CHECKING

import numpy as np

from hexmj.paper.readings import CALIBRATED, CHOICES, agreeing, choice_in
from hexmj.plotting import tidy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

WORDS = {
    "order": "order\nof updates",
    "ipsilateral": "anterior leg\nacts (Eq. 4)",
    "contralateral": "contralateral leg\nacts (Eq. 4)",
    "cap": "what 4 mm\nbound (Eq. 4)",
    "rear": "mechanism 1\nof two legs",
}
OBSERVATION_TIMES = {"walk": ("#1b6ca8", "o", "-"), "start": ("#e08e1b", "^", (0, (1.2, 0.5)))}
"""Colour of each, its marker and the line of its mean."""


def readings_figure(scores: "xr.Dataset") -> "Figure":
    """Held-out claims that agree, a dot for every reading and observation time, by each choice; bars are means."""
    from matplotlib.lines import Line2D

    from hexmj.plotting import head, picture

    figure = picture(11.0, 4.4)
    panels = figure.subplots(1, len(CHOICES), sharey=True, width_ratios=[len(one) for one in CHOICES.values()])
    count, shift = agreeing(scores).sel(constants="inferred"), dict(zip(OBSERVATION_TIMES, (-0.13, 0.13), strict=True))
    for axes, (name, choices) in zip(panels, CHOICES.items(), strict=True):
        of = np.array([choices.index(choice_in(one, name)) for one in scores.model_variant.values.tolist()])
        for observation_time, (colour, marker, line) in OBSERVATION_TIMES.items():
            values = count.sel(observation_time=observation_time).values
            for i in sorted(set(of.tolist())):
                here = values[of == i]
                spread = np.linspace(-0.09, 0.09, len(here))[np.argsort(np.argsort(here, kind="stable"))]
                axes.plot(
                    i + shift[observation_time] + spread,
                    here,
                    marker,
                    color=colour,
                    alpha=0.45,
                    markersize=4,
                    markeredgewidth=0,
                )
                ends = i + shift[observation_time] - 0.12, i + shift[observation_time] + 0.12
                axes.hlines(here.mean(), *ends, color=colour, linewidth=2.4, linestyle=line)
        axes.set_xticks(range(len(choices)), choices)
        axes.set(title=WORDS[name], xlim=(-0.5, len(choices) - 0.5))
        axes.title.set_fontsize(10)
        tidy(axes)
    held = sum(key not in CALIBRATED for key in scores.claim.values)
    panels[0].set_ylabel(f"claims that agree, of {held} held out")
    dots = [
        Line2D([], [], color=colour, marker=marker, linestyle=line, label=f"observation time {name}")
        for name, (colour, marker, line) in OBSERVATION_TIMES.items()
    ]
    figure.legend(handles=dots, frameon=False, fontsize=9, loc="outside lower center", ncols=2)
    head(
        figure,
        f"{scores.sizes['model_variant']} readings of the 1998 paper; the printed choice stands first; constants as inferred",
    )
    return figure
