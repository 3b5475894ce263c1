"""What walks meet in mid-stride, and how they answer (paper, Section 6)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from hexmj.errors import InputError

Kind = Literal["halt", "leg", "push"]
"""All legs stand where they are, or one that protracts does, or the body is pushed, of which the plan knows
nothing."""

Answer = Literal["reorganise", "slow_down", "grasp"]
"""Strategies against a disturbance: legs to the nearest posture of undisturbed walking; a superior level that lowers
the velocity; feet that hold on to the ground, throughout the walk."""

Strategy = Literal["none"] | Answer

NO_DISTURBANCE = "undisturbed"
"""Name of the case in which nothing happens."""

PHYSICAL = ("push", "grasp")
"""Disturbances and strategies of which a plan knows nothing."""

MOST_IMPULSE = 80.0
"""Largest impulse in multiples of m V_p: beyond it the insect is thrown into the air, up to half a metre."""


@dataclass(frozen=True)
class Case:
    """A disturbance and the strategy against it."""

    kind: Kind
    strategy: Strategy
    impulse: float = 0.0
    """Of a push, to the left, in multiples of the insect's mass times V_p; a push of 0 is no disturbance."""

    @property
    def disturbance(self) -> str:
        """Its name: undisturbed, halt, leg, push 20."""
        if self.kind != "push":
            return self.kind
        return f"push {float(self.impulse)}".removesuffix(".0") if self.impulse else NO_DISTURBANCE


def every_case(
    disturbances: Sequence[Kind], impulses: Sequence[float], strategies: Sequence[Answer], physical: bool
) -> list[Case]:
    """The undisturbed walk, then every disturbance without a strategy and with each.

    Raises:
        InputError: names or impulses that make no sense, or that need physics where there are none.
    """
    for name, values, valid in (
        ("disturbances", disturbances, get_args(Kind)),
        ("strategies", strategies, get_args(Answer)),
        ("impulses", impulses, ()),
    ):
        if len(set(values)) < len(values):
            raise InputError(f"{name} = {list(values)}; expected none of them twice")
        if unknown := [value for value in values if valid and value not in valid]:
            raise InputError(f"{name} = {list(values)}; {unknown[0]!r} is none of {', '.join(valid)}")
    if not all(0 < impulse <= MOST_IMPULSE for impulse in impulses):
        raise InputError(f"impulses = {list(impulses)}; expected above 0 and at most {MOST_IMPULSE:g} times m V_p")
    if not disturbances or ("push" in disturbances and not impulses):
        raise InputError("no disturbance was given, or a push without impulses; expected at least one of each")
    if not physical and (needing := [name for name in PHYSICAL if name in (*disturbances, *strategies)]):
        raise InputError(f"{needing[0]!r} without physics; expected others, since a plan knows nothing of it")
    answers: tuple[Strategy, ...] = ("none", *strategies)
    return [Case("push", "none")] + [
        Case(kind, answer, float(impulse))
        for kind in disturbances
        for impulse in (impulses if kind == "push" else (0.0,))
        for answer in answers
    ]
