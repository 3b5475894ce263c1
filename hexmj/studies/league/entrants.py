"""Who takes part, by name."""

from collections.abc import Mapping

from hexmj.controllers.named import load_controller
from hexmj.controllers.rivals.table import RIVALS
from hexmj.studies.league.entrant import Entrant

IDEAL = "-ideal"
"""What the name of an entrant ends with that begins at an ideal start."""

NETWORK = ("uncoordinated", "hws", "ldvs", "own", "own-0.3", "own-0.5", "robust-0.1", "lasting", "lasting-0.3")
"""Sets of the 1998 network that take part."""

EVERYONE = (*NETWORK, *RIVALS, *(f"{name}{IDEAL}" for name in ("wilson", "graham")))
"""The whole league."""

FOUR = ("ldvs", "uncoordinated", "wilson", "graham-ideal")
"""For a quick look."""


def entrants(names: tuple[str, ...]) -> Mapping[str, Entrant]:
    """Entrants by the names of their controllers, which end with `IDEAL` where they begin at an ideal start.

    Raises:
        InputError: no such controller, or one without an ideal start.
    """
    return {name: Entrant(load_controller(name.removesuffix(IDEAL)), name.endswith(IDEAL)) for name in names}
