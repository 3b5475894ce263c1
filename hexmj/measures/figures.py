"""Captions of the figures of all results, and the figures that show FLSS against velocity."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from hexmj.conditions import unusual
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
    **dict.fromkeys(("lift_time", "landing_time", "longest_substep", "contact_gap", "settling_time"), "ms"),
}
"""Field of `Conditions` or `Stride` -> its unit; the other fields are plain numbers or names."""

SYMBOLS = {"vp": "$V_p$", "aep0": "AEP$_0$", "pep0": "PEP$_0$", "pep_min": "PEP_min"}
"""Field of `Conditions` or `Stride` -> its symbol in a caption, if that is not the field's name."""

FEW = 3
"""Maximum number of controllers whose names a caption lists; of more, it lists those that deviate from the paper."""

COLUMNS = 3
"""Maximum number of panels in a row."""


def caption(result: "xr.Dataset", least: int | None = None) -> str:
    """Return a line for a figure's title: controllers, starts, observation time, V_p, and other settings.

    Fields of the stride and the conditions appear if they differ from their defaults. `least`, the minimum number of
    starts behind any frequency of the figure, appears if it is below the number of all starts.
    """
    recorded = settings(result)
    words = [_controllers(recorded.get("controllers", {}), result)]
    if "starts" in recorded:
        words.append(starts_in_words(recorded["starts"]))
    if (time := recorded.get("observation_time")) is not None:
        words.append(f"observation time {f'of {time:g} time units' if isinstance(time, float) else time}")
    if "seed" in recorded:
        words.append(f"seed {recorded['seed']}")
    if acceleration := recorded.get("acceleration"):
        words.append(f"a = {acceleration['rate']:g} from V = {acceleration['start']:g}")
    default, stride = json.loads(json.dumps(asdict(Stride()))), recorded.get("stride") or {}
    changed = {name: value for name, value in stride.items() if value != default.get(name, value)}
    words.append("other lines of the tips" if changed.pop("geometry", None) else "")
    words.append(", ".join(_term(name, value) for name, value in changed.items()))
    if recorded.get("physical", True):
        given = recorded.get("conditions") or {}
        shown = {"vp", *unusual(given)}
        words.append(", ".join(_term(name, value) for name, value in given.items() if name in shown))
    if least not in (None, result.attrs.get("starts")):
        words.append(f"frequencies of at least {least} of them")
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
    """Draw a result of `compare`: FLSS against velocity with 95 % intervals, a panel for each controller."""
    names = result.controller.values
    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    figure = picture(max(5.6, 3.4 * columns), 1.3 + 2.7 * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    shifts = np.linspace(-0.5, 0.5, len(MEASURE_STYLES)) * BESIDE
    for axes, name in zip(panels.ravel(), names, strict=False):
        data = result.sel(controller=name).sortby("velocity")
        for (measure, style), shift in zip(MEASURE_STYLES.items(), shifts, strict=True):
            frequency_curve(axes, data.velocity + shift, data, measure, label=measure, **{"markersize": 4.5} | style)
        axes.set_title(in_figure(name), fontsize=10)
        flss_axes(axes, result.velocity.values)
    for axes in panels.ravel()[len(names) :]:
        axes.set_visible(False)
    handles, _ = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles=handles, **LEGEND, loc="outside lower center", ncols=len(handles))
    head(figure, "Loss of static stability: kinematic, and measured under the feet; physical: falls", caption(result))
    return figure


def flss_figure(result: "xr.Dataset") -> "Figure":
    """Draw a result of `flss` or `physical_flss`: FLSS against velocity with 95 % intervals."""
    figure, kind = picture(6.4, 4.2), "physical" if "fall" in result else "kinematic"
    axes, data = figure.subplots(), result.rename(low="flss_low", high="flss_high").sortby("velocity")
    frequency_curve(axes, data.velocity, data, "flss", **{"markersize": 4.5} | MEASURE_STYLES[kind])
    flss_axes(axes, result.velocity.values)
    head(figure, f"{kind} FLSS with 95 % intervals", caption(result))
    return figure


def _controllers(controllers: Mapping[str, Any], result: "xr.Dataset") -> str:
    """Return the names of at most `FEW` controllers, or of those that deviate from the paper, with their deviations."""
    if axis := [result[name].values for name in ("controller", "entrant") if name in result.coords]:
        controllers = {name: controllers[name] for name in np.ravel(axis[0]).tolist() if name in controllers}
    few, rules = len(controllers) <= FEW, {name: network_rules(controllers[name]) for name in controllers}
    return ", ".join(in_figure(name) + f" ({words})" * bool(words) for name, words in rules.items() if words or few)


def _term(name: str, value: Any) -> str:
    """Return the text 'name = value unit' of a setting, with no-break spaces."""
    number = f"{value:g}" if isinstance(value, float | int) else str(value)
    text = f"{SYMBOLS.get(name, name.replace('_', ' '))} = {number} {UNITS.get(name, '')}"
    return text.strip().replace(" ", "\N{NO-BREAK SPACE}")
