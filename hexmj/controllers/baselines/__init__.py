"""Baseline controllers from the literature, one per file; rules that lift legs build on the base class in `lifted`."""

from hexmj.controllers.baselines.evolved import EVOLVED
from hexmj.controllers.baselines.free_gait import FreeGait
from hexmj.controllers.baselines.metronomes import Metronome, RandomPhase
from hexmj.controllers.baselines.phase_oscillators import PhaseOscillators
from hexmj.controllers.baselines.righetti import Righetti
from hexmj.controllers.baselines.scores import Scores
from hexmj.controllers.baselines.tegotae import Tegotae
from hexmj.controllers.baselines.walknet import REACOG, Walknet
from hexmj.controllers.protocol import Controller

BASELINES: dict[str, Controller] = {
    controller.name: controller
    for controller in (
        Metronome("wilson", "wilson"),
        Metronome("graham", "graham"),
        RandomPhase("graham", "graham-random"),
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
        FreeGait(),
    )
}
"""Name -> baseline controller."""
