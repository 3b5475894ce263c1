"""The paper's claims, from the table of data `claims.toml`, and how each is judged."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hexmj.files import read_toml
from hexmj.paper.quantities import QUANTITIES, Measured
from hexmj.paper.rules import RULES, Answer, Rule
from hexmj.timing import OBSERVATION_TIMES

TABLE = Path(__file__).with_name("claims.toml")


@dataclass(frozen=True)
class Claim:
    """A number or statement of the paper; its fields are explained in `claims.toml`."""

    key: str
    section: str
    text: str
    value: str
    rule: Rule
    calibrates: tuple[str, ...] = ()
    why: str = ""

    @property
    def kind(self) -> str:
        """'calibrated' if a constant was inferred from the claim's number, else 'held out'."""
        return "calibrated" if self.calibrates else "held out"

    def answers(self, measured: Measured) -> dict[str, Answer | None]:
        """Return the answer under each observation time, or one answer under '' if it depends on none."""
        times = OBSERVATION_TIMES if self.rule.quantity.windowed else ("",)
        return {time: self.rule.answer(measured, time) for time in times}


@cache
def claims() -> dict[str, Claim]:
    """Return all claims by key, in the paper's order."""
    return {entry["key"]: _read(entry) for entry in read_toml(TABLE)["claim"]}


@cache
def in_physics() -> list[dict[str, str]]:
    """Return topic, command and text of what only physical walks can answer."""
    return read_toml(TABLE)["in_physics"]


def _read(entry: dict[str, Any]) -> Claim:
    quantity, rule, calibrates = entry.pop("quantity"), entry.pop("rule"), tuple(entry.pop("calibrates", ()))
    measured = QUANTITIES[quantity.pop("kind")](**quantity)
    judge = RULES[rule.pop("kind")](measured, tuple(rule.pop("velocities")), **rule)
    return Claim(**entry, rule=judge, calibrates=calibrates)
