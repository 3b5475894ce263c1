"""Rivals of the 1998 network from the literature, each in a file of its own; all share what `lifted` says."""

from hexmj.controllers.protocol import Controller
from hexmj.controllers.rivals.metronomes import Metronome
from hexmj.controllers.rivals.walknet import REACOG, Walknet

RIVALS: dict[str, Controller] = {
    one.name: one
    for one in (
        Metronome("wilson", "wilson"),
        Metronome("graham", "graham"),
        Walknet(),
        Walknet("walknet-reacog", REACOG),
        Walknet("walknet-load", rules=(1, 2, 3, 5)),
    )
}
"""By the names under which they are found."""
