"""Rivals of the 1998 network from the literature, each in a file of its own; all share what `lifted` says."""

from hexmj.controllers.protocol import Controller
from hexmj.controllers.rivals.evolved import EVOLVED
from hexmj.controllers.rivals.metronomes import Metronome

RIVALS: dict[str, Controller] = {
    one.name: one
    for one in (
        Metronome("wilson", "wilson"),
        Metronome("graham", "graham"),
        EVOLVED,
    )
}
"""By the names under which they are found."""
