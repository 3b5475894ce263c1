"""What walks meet in the league, at one velocity: what disturbs them, and what a robot meets."""

from dataclasses import dataclass, replace

from hexmj.conditions import Conditions
from hexmj.controllers.leg_lost import LegLost
from hexmj.controllers.poor_senses import PoorSenses
from hexmj.controllers.protocol import Controller
from hexmj.studies.disturbance.cases import Case
from hexmj.studies.league.entrant import Entrant
from hexmj.timing import Stride

IMPULSE = 40.0
"""Of the push, in multiples of m V_p."""

DELAY = 0.02
"""How late legs are read [s]."""

NOISE = 0.1
"""Standard deviation of the error of sensed tips, as a part of AEP_0 - PEP_0."""

DISTURBED: dict[str, Case] = {
    "halt": Case("halt", "none"),
    "leg": Case("leg", "none"),
    "push": Case("push", "none", IMPULSE),
}
"""Disturbances of walks whose plan is stable until then; each begins at a moment of its own."""

GROUNDS = ("step", "rough")
"""What lies ahead, as near as the body allows: even slow walks come to it with all legs."""

HEIGHT = 0.3
"""Of the ground, in standing heights of the body."""

HELD = 1.2
"""Height at which a lost leg is held, in standing heights of the body or of the walk, whichever is higher: off the
ground, however short the steps, until the body tips onto it."""

LOAD = 1.0
"""What is carried, in weights of the body."""

LEGS_LOST = {f"lost {leg + 1}": leg for leg in (0, 1, 2)}
"""Name of a trial -> index of the leg that is lost, one at a time: front, middle, hind."""

READING: tuple[str, ...] = ("reads", "noise", "late")
"""Controllers that can read the legs do so, then inexactly, then late."""

TRIALS = (*DISTURBED, *GROUNDS, "load", *LEGS_LOST, *READING)
"""All of them, by name."""

TOLD = (
    "halt, leg, push: a halt, a protracting leg that is stopped, a push of 40 m V_p, of walks whose plan was stable"
    f" until then; step and rough ground of {HEIGHT:g} of the body's standing height; load: twice the weight; lost: one"
    " leg, from the front; reads: the legs are read; noise, late: with errors of 10 % of the step range, 20 ms late, in"
    " whole steps; - where plans cannot be steered or read no legs, a step is too long, or a walk too short, for what"
    " happens, the walk ends before the ground, or no walk is left that is stable, and has not fallen, until then"
)
"""What they are."""


@dataclass(frozen=True)
class Walking:
    """A trial in which a controller walks from the start on."""

    controller: Controller
    """The entrant's own, or what was made of it."""
    conditions: Conditions
    """In which it walks."""


def crossed(conditions: Conditions) -> float:
    """Way after which all legs of a body have come to the ground of a trial [mm]."""
    return conditions.body.lengths.nearest_obstacle * 5.0 / 3.0


def walking(name: str, entrant: Entrant, conditions: Conditions, velocity: float, stride: Stride) -> Walking | None:
    """Who walks at V_r in a trial that is no disturbance, and where; None where the entrant cannot read its legs, or
    not so late, since its steps are longer."""
    controller, body = entrant.controller, conditions.body
    if name in GROUNDS:
        near, high = body.lengths.nearest_obstacle, HEIGHT * body.standing_height
        return Walking(controller, replace(conditions, ground=name, ground_height=high, ground_at=near))
    if name == "load":
        return Walking(controller, replace(conditions, load=LOAD))
    if name in LEGS_LOST:
        held = HELD * max(conditions.standing_height, body.standing_height)
        return Walking(LegLost(controller, LEGS_LOST[name], held), conditions)
    late, reading = DELAY * conditions.vp, entrant.reading(velocity, stride)
    if reading is None or (name == "late" and not round(late / stride.dt)):
        return None
    senses = (reading, PoorSenses(reading, noise=NOISE), PoorSenses(reading, delay=late))
    return Walking(dict(zip(READING, senses, strict=True))[name], conditions)
