"""All rivals by name."""

from hexmj.controllers.protocol import Controller
from hexmj.controllers.rivals.evolved import EVOLVED
from hexmj.controllers.rivals.metronomes import Metronome
from hexmj.controllers.rivals.phase_oscillators import PhaseOscillators
from hexmj.controllers.rivals.righetti import Righetti
from hexmj.controllers.rivals.scores import Scores
from hexmj.controllers.rivals.tegotae import Tegotae
from hexmj.controllers.rivals.walknet import REACOG, Walknet

RIVALS: dict[str, Controller] = {
    one.name: one
    for one in (
        Metronome("wilson", "wilson"),
        Metronome("graham", "graham"),
        Walknet(),
        Walknet("walknet-reacog", REACOG),
        Walknet("walknet-load", rules=(1, 2, 3, 5)),
        PhaseOscillators("tripod", name="cpg-tripod"),
        PhaseOscillators("tetrapod", name="cpg-tetrapod"),
        PhaseOscillators("wave", name="cpg-wave"),
        Scores(),
        Righetti(),
        Tegotae(),
        EVOLVED,
    )
}
"""By the names under which they are found."""
