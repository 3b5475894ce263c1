"""Who takes part, by name."""

from collections.abc import Callable, Mapping

from hexmj.controllers.baselines.table import BASELINES
from hexmj.controllers.named import load_controller
from hexmj.controllers.protocol import Controller
from hexmj.studies.league.entrant import Entrant
from hexmj.studies.short_names import short_names

IDEAL = "-ideal"
"""What the name of an entrant ends with that begins at an ideal start."""

NETWORK = ("uncoordinated", "hws", "ldvs", "own", "own-0.3", "own-0.5", "robust-0.1", "lasting", "lasting-0.3")
"""Sets of the 1998 network that take part."""

EVERYONE = (*NETWORK, *BASELINES, *(f"{name}{IDEAL}" for name in ("wilson", "graham")))
"""The whole league."""

FOUR = ("ldvs", "uncoordinated", "wilson", "graham-ideal")
"""For a quick look."""


def entrants(names: tuple[str, ...], load: Callable[[str], Controller] = load_controller) -> Mapping[str, Entrant]:
    """Entrants by short names, see `short_names`, in their order.

    Args:
        names: of controllers, which end with `IDEAL` where they begin at an ideal start.
        load: gives a controller by its name.

    Raises:
        InputError: no such controller, or one without an ideal start.
    """
    found = {name: load(name.removesuffix(IDEAL)) for name in names}
    short = short_names({name.removesuffix(IDEAL): one for name, one in found.items()})
    shown = [short[name.removesuffix(IDEAL)] + (IDEAL if name.endswith(IDEAL) else "") for name in names]
    keys = shown if len({*shown}) == len(names) else names
    return {key: Entrant(found[name], name.endswith(IDEAL)) for key, name in zip(keys, names, strict=True)}
