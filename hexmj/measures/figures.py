"""Captions of results, and the figures of FLSS against velocity."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
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
"""Units of conditions and of a stride's fields; the others are numbers or names."""

SYMBOLS = {"vp": "$V_p$", "aep0": "AEP$_0$", "pep0": "PEP$_0$", "pep_min": "PEP_min"}
"""Their names in a caption, where these differ."""

FEW = 3
"""Most controllers that a caption names."""

COLUMNS = 3
"""Most panels beside each other."""


def caption(result: "xr.Dataset") -> str:
    """Return a line for a figure's title: controllers, starts, observation time, V_p, and other settings."""
    made = settings(result)
    axis = next((result[name].values for name in ("controller", "entrant") if name in result.coords), None)
    names = None if axis is None else np.ravel(axis).tolist()
    physical = conditions_in_words(made) if made.get("physical", True) else ""
    return "; ".join(
        filter(None, [_controllers(made, names), *_walks(made), _stride(made.get("stride") or {}), physical])
    )


def caption_of_at_least(least: int, result: "xr.Dataset") -> str:
    """Return the caption with the least number of starts that a frequency counts, if that is not all."""
    more = "" if least == result.attrs.get("starts") else f"; frequencies of at least {least} of them"
    return caption(result) + more


def starts_in_words(number: int) -> str:
    """Return a number of starts as a text."""
    return "1 start" if number == 1 else f"{number} starts"


def conditions_in_words(made: Mapping[str, Any]) -> str:
    """Return V_p and the conditions that are not defaults, from a result's settings; empty for a kinematic result."""
    given = made.get("conditions") or {}
    shown = {"vp", *unusual(given)}
    return ", ".join(_term(name, value) for name, value in given.items() if name in shown)


def not_printed(controllers: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the networks that do not plan as printed in 1998: rules -> names, from settings by name."""
    found: dict[str, list[str]] = {}
    for name, controller in controllers.items():
        if words := network_rules(controller):
            found.setdefault(words, []).append(name)
    return found


def network_rules(controller: Any) -> str:
    """Return the order of updates and the model variant of a network that are not as printed, from its settings."""
    if not isinstance(controller, Mapping):
        return ""
    if "controller" in controller:
        return network_rules(controller["controller"])
    from hexmj.controllers.cruse1998 import ModelVariant, in_words

    choices, variant = {field.name for field in fields(ModelVariant)}, controller.get("model_variant")
    if "order" not in controller or not isinstance(variant, Mapping) or not choices <= variant.keys():
        return ""  # another controller, such as Walknet
    found = [f"{controller['order']} order"] if controller["order"] != "printed" else []
    chosen = ModelVariant(**{name: variant[name] for name in choices})
    return ", ".join(found + ([f"model variant {in_words(chosen)}"] if chosen != ModelVariant() else []))


def comparison_figure(result: "xr.Dataset") -> "Figure":
    """Draw FLSS against velocity with 95 % intervals, a panel for each controller, from `compare`."""
    names = result.controller.values
    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    figure = picture(max(5.6, 3.4 * columns), 1.3 + 2.7 * rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    shifts = np.linspace(-0.5, 0.5, len(MEASURE_STYLES)) * BESIDE
    for axes, name in zip(panels.ravel(), names, strict=False):
        data = result.sel(controller=name).sortby("velocity")
        for (measure, style), shift in zip(MEASURE_STYLES.items(), shifts, strict=True):
            frequency_curve(axes, data.velocity + shift, data, measure, label=measure, **{"markersize": 4.5} | style)
        axes.set_title(in_figure(name), fontsize=10)
        flss_axes(axes, result.velocity.values)
    for n, axes in enumerate(panels.ravel()):
        axes.set_visible(n < len(names))
        lowest = n + columns >= len(names)
        axes.tick_params(labelbottom=lowest)
        axes.set(xlabel=axes.get_xlabel() if lowest else "", ylabel="" if n % columns else "FLSS")
    handles, _ = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles=handles, **LEGEND, loc="outside lower center", ncols=len(handles))
    head(figure, "Loss of static stability: kinematic, and measured under the feet; physical: falls", caption(result))
    return figure


def flss_figure(result: "xr.Dataset") -> "Figure":
    """Draw FLSS against velocity with 95 % intervals, from `flss` or `physical_flss`."""
    figure, kind = picture(6.4, 4.2), "physical" if "fall" in result else "kinematic"
    axes, data = figure.subplots(), result.rename(low="flss_low", high="flss_high").sortby("velocity")
    frequency_curve(axes, data.velocity, data, "flss", **{"markersize": 4.5} | MEASURE_STYLES[kind])
    flss_axes(axes, result.velocity.values)
    head(figure, f"{kind} FLSS with 95 % intervals", caption(result))
    return figure


def _controllers(made: Mapping[str, Any], names: Iterable[str] | None) -> str:
    """Return the names of a few controllers with what is not as printed in 1998, or only the latter for many."""
    every = made.get("controllers", {})
    shown = {name: every.get(name) for name in names if name in every} if names is not None else every
    if len(shown) > FEW:
        rules = not_printed(shown)
        return "; ".join(f"{words}: {', '.join(map(in_figure, found))}" for words, found in rules.items())
    rules = {name: network_rules(controller) for name, controller in shown.items()}
    return ", ".join(in_figure(name) + (f" ({words})" if words else "") for name, words in rules.items())


def _walks(made: Mapping[str, Any]) -> list[str]:
    """Return starts, observation time, seed and acceleration, as far as a result has them."""
    time = made.get("observation_time")
    words = [starts_in_words(made["starts"])] if "starts" in made else []
    if time is not None:
        words.append(f"observation time {f'of {time:g} time units' if isinstance(time, float) else time}")
    words += [f"seed {made['seed']}"] if "seed" in made else []
    if acceleration := made.get("acceleration"):
        words.append(f"a = {acceleration['rate']:g} from V = {acceleration['start']:g}")
    return words


def _stride(stride: Mapping[str, Any]) -> str:
    """Return what differs from the default stride."""
    usual = asdict(Stride())
    changed = [name for name in usual if name != "geometry" and stride.get(name, usual[name]) != usual[name]]
    words = [_term(name, stride[name]) for name in changed]
    lines = {name: [*values] for name, values in usual["geometry"].items()}
    return ", ".join(words + (["other lines of the tips"] if stride.get("geometry", lines) != lines else []))


def _term(name: str, value: Any) -> str:
    """Return a setting with its unit, without breaks."""
    number = f"{value:g}" if isinstance(value, float | int) else str(value)
    text = f"{SYMBOLS.get(name, name.replace('_', ' '))} = {number} {UNITS.get(name, '')}"
    return text.strip().replace(" ", "\N{NO-BREAK SPACE}")
