"""On which starts searches found a controller: there it looks better than it is."""

from typing import Any

from hexmj.controllers.baselines.evolved import EVOLVED, FOUND, Evolved
from hexmj.controllers.cruse1998 import PRESETS, Cruse1998
from hexmj.controllers.cruse1998.presets import own_tables
from hexmj.controllers.named import parameter_file
from hexmj.controllers.protocol import Controller
from hexmj.controllers.varied_names import PART
from hexmj.files import SEARCHED, read_toml
from hexmj.plain import plain


def searched_on(name: str, controller: Controller) -> dict[str, list[int]]:
    """What searches have found of a controller, by name -> the seeds of their starts, its own and those of the searches
    that they began with.

    It is what its file says of itself, or one of our own sets under any name; the same without some parts counts, too.

    Args:
        name: as `load_controller` takes it.
        controller: what that gives.

    Raises:
        InputError: a file that cannot be read.
    """
    whole = PART.sub("", name)
    names = [whole] if whole in PRESETS else []
    if isinstance(controller, Cruse1998):
        weights = plain(controller.weights)
        names += [preset for preset, usual in PRESETS.items() if plain(usual.weights) == weights]
    told = {preset: _seeds(own_tables().get(preset, {})) for preset in names}
    if whole == EVOLVED.name or (isinstance(controller, Evolved) and controller == EVOLVED):
        told[EVOLVED.name] = _seeds(read_toml(FOUND))
    elif file := parameter_file(whole):
        told[whole] = _seeds(read_toml(file))
    return {what: seeds for what, seeds in told.items() if seeds}


def _seeds(table: dict[str, Any]) -> list[int]:
    """What a table says of searches; nothing where it makes no sense."""
    told = table.get(SEARCHED)
    seeds = told.get("seeds") if isinstance(told, dict) else None
    return [one for one in seeds if type(one) is int] if isinstance(seeds, list) else []
