"""Captions of the figures of all results, and the figures that show FLSS against velocity."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from itertools import product
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.conditions import Conditions, unusual
from hexmj.io import settings
from hexmj.plotting import BESIDE, LEGEND, MEASURE_STYLES, flss_axes, frequency_curve, head, in_figure, picture
from hexmj.timing import Stride

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

UNITS: dict[str, str] = {
    "vp": "mm/s",
    **dict.fromkeys(("step_height", "standing_height", "centre_of_mass", "ground_height"), "mm"),
    **dict.fromkeys(("ground_at", "ground_length", "aep0", "pep0", "pep_min"), "mm"),
    **dict.fromkeys(("pitch", "roll"), "rad"),
    **dict.fromkeys(("lift_time", "landing_time", "longest_substep", "contact_gap", "settling_time"), "ms"),
    "softness": "ms",
}
"""Field of `Conditions` or `Stride` -> its unit; the other fields are plain numbers or names."""

SYMBOLS = {"vp": "$V_p$", "aep0": "AEP$_0$", "pep0": "PEP$_0$", "pep_min": "PEP_min"}
"""Field of `Conditions` or `Stride` -> its symbol in a caption, if that is not the field's name."""

TIMES = {"walk": "three periods of a leg", "start": "two swings"}
"""Named observation time -> its text in a caption."""

FEW = 3
"""Maximum number of panels in a row, and of controllers whose names a caption lists; of more, it lists those that
deviate from the paper."""

MOST = 12
"""Maximum number of panels of a comparison."""


def caption(result: "xr.Dataset") -> str:
    """Return a line for a figure's title: controllers, starts, observation time, V_p, and other settings.

    Fields of the stride and the conditions appear if they differ from their defaults. A condition that is a coordinate
    of the result appears with the values of the coordinate instead of the recorded value.
    """
    recorded = settings(result)
    words = [_controllers(recorded.get("controllers", {}), result)]
    if "walks" in result:
        fewest, most = int(result.walks.min()), int(result.walks.max())
        walked = f"{fewest} to {most}" if most > fewest else f"{most}"
        words.append(f"{walked} of {recorded['starts']} planned starts walk")
    elif "starts" in recorded:
        words.append(starts_in_words(recorded["starts"]))
    if (time := recorded.get("observation_time")) is not None:
        length = f"{time:g} time units" if isinstance(time, float) else TIMES.get(time, time)
        words.append(f"observation time: {length}")
    if recorded.get("protocol") == "steady":
        words.append("from steady state")
    if "seed" in recorded:
        words.append(f"seed {recorded['seed']}")
    if acceleration := recorded.get("acceleration"):
        words.append(f"a = {acceleration['rate']:g} from V = {acceleration['start']:g}")
    default, stride = json.loads(json.dumps(asdict(Stride()))), recorded.get("stride") or {}
    changed = {name: value for name, value in stride.items() if value != default.get(name, value)}
    words.append("other lines of the tips" if changed.pop("geometry", None) else "")
    words.append(", ".join(_term(name, value) for name, value in changed.items()))
    given = recorded.get("conditions") or {}
    shown = {name: given[name] for name in given if name in {"vp", *unusual(given)}}
    shown |= {name: axis.values for name, axis in result.coords.items() if axis.dims in ((), (name,))}
    words.append(", ".join(_term(name, shown[name]) for name in Conditions().settings() if name in shown))
    return "; ".join(filter(None, words))


def starts_in_words(number: int) -> str:
    """Return '1 start' or, for another number, 'N starts'."""
    return "1 start" if number == 1 else f"{number} starts"


def network_rules(controller: Any) -> str:
    """Return how the network with these settings deviates from the printed update order and model, or an empty text."""
    if not isinstance(controller, Mapping):
        return ""
    if "controller" in controller:
        return network_rules(controller["controller"])
    if not {"order", "model_variant"} <= controller.keys():
        return ""
    from hexmj.controllers.cruse1998 import ModelVariant, variant_name

    variant, words = ModelVariant(**controller["model_variant"]), []
    if controller["order"] != "printed":
        words.append(f"{controller['order']} order")
    if variant != ModelVariant():
        words.append(f"model variant {variant_name(variant)}")
    return ", ".join(words)


def comparison_figure(result: "xr.Dataset") -> "Figure":
    """Draw a result of `compare`: frequencies against velocity with 95 % intervals, in at most `MOST` panels.

    There is a panel for each controller and combination of other axes.
    """
    result = result.sortby("velocity")
    panels, shown = _panels(result), {name: style for name, style in MEASURE_STYLES.items() if name in result}
    drawn, combinations = list(panels.items())[:MOST], len(panels) // result.sizes["controller"]
    columns = min(FEW, len(drawn), combinations if combinations > 1 else FEW)
    rows = -(-len(drawn) // columns)
    figure = picture(max(7.0, 3.4 * columns), 1.6 + 2.9 * rows)
    every = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes in every[len(drawn) :]:
        axes.remove()
    shifts = np.linspace(-0.5, 0.5, len(shown)) * BESIDE
    for number, (axes, (title, data)) in enumerate(zip(every, drawn, strict=False)):
        for (measure, style), shift in zip(shown.items(), shifts, strict=True):
            frequency_curve(axes, data.velocity + shift, data, measure, **style)
        axes.set_title("\n".join(wrap(title, 36, break_long_words=False)), fontsize=11)
        flss_axes(axes, result.velocity.values, "" if number % columns else "share of the starts")
    handles, _ = every[0].get_legend_handles_labels()
    figure.legend(handles=handles, **LEGEND, loc="outside lower center", ncols=2)
    away = (abs(result[measure] - result.physical).mean().item() for measure in ("kinematic", "dynamic"))
    finding = "mean distance from the frequency of falls: kinematic FLSS {:.2f}, FLDS {:.2f}".format(*away)
    part = f"the first {MOST} of {len(panels)} panels" if len(panels) > MOST else ""
    head(figure, finding, caption(result), "bars: 95 % intervals", part)
    return figure


def axes_of(result: "xr.Dataset") -> list[str]:
    """Return the axes of a comparison except controller, velocity and start, such as ["vp"]."""
    return [str(axis) for axis in result.physical.dims if axis not in ("controller", "velocity")]


def _panels(result: "xr.Dataset") -> "dict[str, xr.Dataset]":
    """Return title -> data, (velocity, start), of the panels of a comparison, those of the first controller first."""
    axes, panels = sorted(axes_of(result)), {}
    for name, *point in product(result.controller.values, *(result[axis].values.tolist() for axis in axes)):
        terms = [_term(axis, value) for axis, value in zip(axes, point, strict=True)]
        title = ", ".join([in_figure(name)] * (result.sizes["controller"] > 1 or not terms) + terms)
        data = result.sel(controller=name, **dict(zip(axes, point, strict=True)))
        panels[title] = data.transpose("velocity", "start", ...)
    return panels


def flss_figure(result: "xr.Dataset") -> "Figure":
    """Draw a result of `flss` or `physical_flss`: the frequency against velocity with 95 % intervals."""
    name, measure, label = "flss", "kinematic", "kinematic FLSS"
    if "flds" in result:
        name, measure, label = "flds", "dynamic", "FLDS"
    elif "fall" in result:
        measure, label = "physical", "frequency of falls"
    figure, data = picture(7.0, 4.4), result.rename(low=f"{name}_low", high=f"{name}_high").sortby("velocity")
    axes = figure.subplots()
    frequency_curve(axes, data.velocity, data, name, **MEASURE_STYLES[measure])
    flss_axes(axes, result.velocity.values, label)
    ends = (data.isel(velocity=i) for i in [0, -1][: data.sizes["velocity"]])
    values = " and ".join(f"{end[name]:.2f} at V = {end.velocity:g}" for end in ends)
    head(figure, f"the {label} is {values}", caption(result), "bars: 95 % intervals")
    return figure


def _controllers(controllers: Mapping[str, Any], result: "xr.Dataset") -> str:
    """Return the names of at most `FEW` controllers, or of those that deviate from the paper, with their deviations."""
    if "controller" in result.coords:
        names = np.ravel(result.controller.values).tolist()
        controllers = {name: controllers[name] for name in names if name in controllers}
    few, rules = len(controllers) <= FEW, {name: network_rules(controllers[name]) for name in controllers}
    return ", ".join(in_figure(name) + f" ({words})" * bool(words) for name, words in rules.items() if words or few)


def _term(name: str, values: Any) -> str:
    """Return the text 'name = value unit' of a setting with one or several values, with no-break spaces."""
    numbers = [f"{v:g}" if isinstance(v, float | int) else str(v) for v in np.unique(values).tolist()]
    text = f"{SYMBOLS.get(name, name.replace('_', ' '))} = {', '.join(numbers)} {UNITS.get(name, '')}"
    return text.strip().replace(" ", "\N{NO-BREAK SPACE}")
