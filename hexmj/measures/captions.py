"""What a figure's title tells of a result: who walked, from how many starts, how long, under which conditions."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

from hexmj.conditions import unusual
from hexmj.errors import InputError
from hexmj.io import settings
from hexmj.pictures import in_figure
from hexmj.timing import Stride

if TYPE_CHECKING:
    import xarray as xr

WORDS = {
    "vp": "$V_p$ = {:g} mm/s",
    "step_height": "step height {:g} mm",
    "standing_height": "standing height {:g} mm",
    "lift_time": "lift time {:g} ms",
    "landing_time": "landing time {:g} ms",
    "load": "load {:g} times the weight",
    "centre_of_mass": "centre of mass {:g} mm ahead of O",
    "leg_mass": "legs' mass x {:g}",
    "friction": "friction {:g}",
    "grasp": "grasp {:g}",
    "ground": "ground: {}",
    "ground_height": "{:g} mm high",
    "ground_at": "obstacle at {:g} mm",
    "ground_length": "{:g} mm long",
    "ground_seed": "seed {:g} of the bumps",
    "longest_substep": "physics steps of at most {:g} ms",
    "contact_gap": "contact gap {:g} ms",
    "settling_time": "settling {:g} ms",
    "body": "body {}",
}
"""Condition -> how it is told."""

NO_BREAK = "\N{NO-BREAK SPACE}"
"""Between a condition's number and its unit, which stay in one line."""

WALKS = {"observation_time": "observation time {}", "seed": "seed {}"}
"""What is told of the walks, beside the number of starts."""

STRIDE = {"aep0": "AEP$_0$ = {:g} mm", "pep0": "PEP$_0$ = {:g} mm", "pep_min": "PEP_min = {:g} mm", "dt": "dt = {:g}"}
"""Field of a stride -> how it is told."""

NAMED = "controller", "entrant"
"""Axes of controllers by name."""

FEW = 3
"""Most controllers whose names a title tells."""


def caption(result: "xr.Dataset") -> str:
    """One line for the title of a figure: who walked, and of stride and conditions V_p and what is not as usual.

    Raises:
        InputError: a controller that the result's settings do not tell of.
    """
    told = settings(result)
    told["controllers"] = _shown(result, told)
    of_bodies = conditions(told) if told.get("physical", True) else ""
    return "; ".join(filter(None, [controllers(told), *_walks(told), _stride(told.get("stride") or {}), of_bodies]))


def caption_of_at_least(least: int, result: "xr.Dataset") -> str:
    """The caption, and of how many of its starts the frequencies are where some do not count."""
    told = caption(result)
    return told if least == result.attrs["starts"] else f"{told}; frequencies of at least {least} of them"


def _shown(result: "xr.Dataset", told: Mapping[str, Any]) -> dict[str, Any]:
    """Name -> settings of the controllers along a result's axis of them, or of all without such an axis."""
    axis = next((name for name in NAMED if name in result.coords), None)
    if axis is None:
        return told.get("controllers", {})
    names = result[axis].values.ravel().tolist()
    known = told.get("controllers", dict.fromkeys(names))
    if unknown := [name for name in names if name not in known]:
        raise InputError(
            f"a result of the controller {unknown[0]!r:.80}, but with the settings of {', '.join(known):.200}; expected"
            ' controllers that walked together, or results joined with combine_attrs="drop_conflicts"'
        )
    return {name: one for name, one in known.items() if name in names}


def controllers(told: dict[str, Any]) -> str:
    """The names of a result's controllers as they stand in figures, with what is not as printed in 1998; of many
    controllers that alone."""
    several = told.get("controllers", {})
    if len(several) > FEW:
        found = told.get("not_printed", not_printed(told))
        shown = {words: [in_figure(name) for name in names if name in several] for words, names in found.items()}
        return "; ".join(f"{words}: {', '.join(names)}" for words, names in shown.items() if names)
    return ", ".join(
        in_figure(name) + (f" ({words})" if (words := rules(one)) else "") for name, one in several.items()
    )


def not_printed(told: Mapping[str, Any]) -> dict[str, list[str]]:
    """Sets of the network that do not plan as printed in 1998: the words of their order and reading -> their names."""
    found: dict[str, list[str]] = {}
    for name, one in told.get("controllers", {}).items():
        if words := rules(one):
            found.setdefault(words, []).append(name)
    return found


def conditions(told: dict[str, Any]) -> str:
    """V_p and the conditions that are not the usual ones; nothing of a result on paper."""
    given = told.get("conditions") or {}
    shown = {"vp", *unusual(given)} & given.keys()
    words = [WORDS[name].format(given[name]).replace(" ", NO_BREAK) for name in WORDS if name in shown]
    return ", ".join(words)


def _stride(told: Mapping[str, Any]) -> str:
    """What is not as usual of a stride's settings."""
    usual = asdict(Stride())
    words = [word.format(told[name]) for name, word in STRIDE.items() if told.get(name, usual[name]) != usual[name]]
    lines = {name: [*values] for name, values in usual["geometry"].items()}
    other = told.get("geometry", lines) != lines
    return ", ".join(word.replace(" ", NO_BREAK) for word in [*words, *(["other lines of the tips"] if other else [])])


def _walks(told: dict[str, Any]) -> list[str]:
    """Starts, observation time, seed and acceleration, as far as a result has them."""
    observation_time = told.get("observation_time")
    own = {"observation_time": f"of {observation_time:g} time units"} if isinstance(observation_time, float) else {}
    found = [starts_in_words(told["starts"])] if "starts" in told else []
    found += [word.format((told | own)[name]) for name, word in WALKS.items() if name in told]
    if acceleration := told.get("acceleration"):
        found.append(f"a = {acceleration['rate']:g} from V = {acceleration['start']:g}")
    return found


def starts_in_words(number: int) -> str:
    """A number of starts in words."""
    return "1 start" if number == 1 else f"{number} starts"


def rules(controller: Any) -> str:
    """Order of updates and reading of a set of the network, of its settings, where they are not as printed."""
    if not isinstance(controller, Mapping):
        return ""
    if "controller" in controller:
        return rules(controller["controller"])
    from hexmj.controllers.cruse1998.model_variants import ModelVariant, in_words

    choices, model_variant = {one.name for one in fields(ModelVariant)}, controller.get("model_variant")
    if "order" not in controller or not isinstance(model_variant, Mapping) or not choices <= model_variant.keys():
        return ""  # such as Walknet, which is read in another way
    found = [f"{controller['order']} order"] if controller["order"] != "printed" else []
    chosen = ModelVariant(**{name: model_variant[name] for name in choices})
    found += [f"reading {in_words(chosen)}"] if chosen != ModelVariant() else []
    return ", ".join(found)
