"""The table of claims: each judged over both observation times, as rows, Markdown and JSON."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from hexmj.io import markdown_table
from hexmj.paper.claims import IN_PHYSICS, Claim
from hexmj.paper.found_sets import SEARCH_SEEDS
from hexmj.paper.protocol import FULL, QUICK
from hexmj.paper.quantities import Measured
from hexmj.paper.rules import Answer
from hexmj.timing import OBSERVATION_TIMES

NOT_SEARCHED = "not yet searched"
SAME = "same"
"""Stands under the second observation time where no observation time is involved."""
KINDS = ("held out", "calibrated")
"""Whether a constant was inferred from the number that a claim is about, see `claims.INFERRED_FROM`."""


@dataclass(frozen=True)
class Row:
    """A claim with our answers."""

    claim: Claim
    answers: dict[str, Answer | None]
    """By observation time; one, under '', where no observation time is involved; None where a set has not been searched yet."""
    beside: "dict[str, Row]" = field(default_factory=dict)
    """The same claim under other readings of the network, by their names."""

    @property
    def verdicts(self) -> dict[str, str]:
        """By observation time: agrees, differs or not yet searched."""
        return {
            observation_time: NOT_SEARCHED if one is None else "agrees" if one.agrees else "differs"
            for observation_time, one in self.answers.items()
        }

    @property
    def fits(self) -> str:
        """Which observation time the paper's numbers fit: a observation time, both or neither; empty where that is not the question."""
        if set(self.answers) == {""} or NOT_SEARCHED in self.verdicts.values():
            return ""
        agreeing = [observation_time for observation_time, verdict in self.verdicts.items() if verdict == "agrees"]
        return "both" if len(agreeing) == len(OBSERVATION_TIMES) else next(iter(agreeing), "neither")

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        return KINDS[bool(self.claim.calibrates)]

    @property
    def cells(self) -> tuple[str, ...]:
        """What `heads` names: our answers under each observation time, those of other readings, which observation time fits, why."""
        why = self.claim.why if "differs" in self.verdicts.values() else ""
        kind = f"{self.kind}: {'; '.join(self.claim.calibrates)}" if self.claim.calibrates else self.kind
        answered = [cell for row in (self, *self.beside.values()) for cell in row.ours]
        return self.claim.section, self.claim.words, self.claim.value, kind, *answered, self.fits, why

    @property
    def ours(self) -> list[str]:
        """Our answers under each observation time."""
        told = [
            f"{verdict}: {_number(answer)}" if answer else verdict
            for verdict, answer in zip(self.verdicts.values(), self.answers.values(), strict=True)
        ]
        return told + [SAME] * (len(OBSERVATION_TIMES) - len(told))


def heads(rows: Sequence[Row]) -> tuple[str, ...]:
    """Of the columns of `Row.cells`."""
    model_variants = ("ours", *(rows[0].beside if rows else ()))
    answers = (
        f"{model_variant}, {observation_time}"
        for model_variant in model_variants
        for observation_time in OBSERVATION_TIMES
    )
    return "section", "the paper", "its value", "kind", *answers, "fits", "why"


def heads_beside(model_variant: str) -> tuple[str, ...]:
    """Of the columns of `cells_beside`."""
    return (
        "section",
        "the paper",
        "its value",
        *(f"{model_variant}, {observation_time}" for observation_time in OBSERVATION_TIMES),
    )


def cells_beside(rows: Sequence[Row], model_variant: str) -> list[tuple[str, ...]]:
    """What `heads_beside` names, of each claim: our answers under another reading alone."""
    return [(one.claim.section, one.claim.words, one.claim.value, *one.beside[model_variant].ours) for one in rows]


def judge(claim: Claim, measured: Measured) -> Row:
    """Judge a claim over both observation times, or once where no observation time is involved."""
    observation_times = OBSERVATION_TIMES if claim.rule.quantity.windowed else ("",)
    return Row(
        claim,
        {observation_time: claim.rule.answer(measured, observation_time) for observation_time in observation_times},
    )


def summary(rows: Sequence[Row]) -> list[str]:
    """Sentences that count the verdicts, those of calibrated claims apart."""
    lines = []
    for observation_times, of in ((OBSERVATION_TIMES, "claims on FLSS and sets"), (("",), "claims on gaits")):
        for observation_time in observation_times:
            judged = [row for row in rows if observation_time in row.verdicts]
            counts = [
                f"{kind} {_counts([r.verdicts[observation_time] for r in judged if r.kind == kind])}" for kind in KINDS
            ]
            lines.append(
                f"{of}{f', observation_time {observation_time}' if observation_time else ''}: {'; '.join(counts)}"
            )
    fits = [row.fits for row in rows if row.fits]
    counts = ", ".join(f"{name} {fits.count(name)}" for name in ("both", *OBSERVATION_TIMES, "neither"))
    return [*lines, f"which observation time the paper's numbers fit: {counts}"]


def on_searched_starts(seed: int) -> list[str]:
    """That ideal sets look better than they are on starts on which they were searched, if those of a seed are."""
    told = f"seed {seed}: ideal sets were searched on these starts, where they look better than they are"
    return [told] if seed in SEARCH_SEEDS else []


def claims_markdown(rows: Sequence[Row], settings: dict[str, Any]) -> str:
    """The table, the rule of every row, and the command that recomputes it."""
    size = f"{settings['samples']} times {settings['sample']} starts, gaits from {settings['gait_starts']} starts"
    head = ["# The claims of the 1998 paper", "", f"{size}; seed {settings['seed']}.  An answer is the number that"]
    head[-1] += " strains the rule most, with its 95 % interval, and where."
    told = [*summary(rows), *on_searched_starts(settings["seed"])]
    lines = [*head, "", *(f"- {one}" for one in told), ""]
    beside = summary_beside(rows)
    lines += [*(f"- {one}" for one in beside), ""] if beside else []
    cells = [[cell.replace("differs:", "**differs**:") for cell in row.cells] for row in rows]
    rules = [(row.claim.words, row.claim.rule.words, f"`{_command(row, settings)}`") for row in rows]
    lines += [*markdown_table(heads(rows), cells), "", "## Rules and commands", ""]
    lines += markdown_table(("the paper", "agrees if", "command"), rules)
    lines += ["", "## Judged in physics", "", "What a plan knows nothing of; docs/experiments.md has the answers.", ""]
    lines += [f"- {name} (Section 6): {told}; `{command}`" for name, (command, told) in IN_PHYSICS.items()]
    return "\n".join(lines) + "\n"


def claims_json(rows: Sequence[Row], settings: dict[str, Any]) -> dict[str, Any]:
    """The same as plain numbers and texts."""
    claims = []
    for row in rows:
        claim = row.claim
        told = {"key": claim.key, "section": claim.section, "paper": claim.words, "value": claim.value}
        told |= {"kind": row.kind, "calibrates": list(claim.calibrates)}
        how = {"rule": claim.rule.words, "fits": row.fits, "why": claim.why, "command": _command(row, settings)}
        beside = {name: _answers(other) for name, other in row.beside.items()}
        claims.append(told | {"ours": _answers(row), "beside": beside} | how)
    told = [*summary(rows), *on_searched_starts(settings["seed"]), *summary_beside(rows)]
    return {"claims": claims, "summary": told, "protocol": settings}


def summary_beside(rows: Sequence[Row]) -> list[str]:
    """Sentences that count the verdicts under the other readings."""
    names = rows[0].beside if rows else ()
    return [f"reading {name}, {one}" for name in names for one in summary([row.beside[name] for row in rows])]


def _answers(row: Row) -> dict[str, dict[str, Any]]:
    """Verdicts and numbers, by observation time."""
    return {
        observation_time or "any": {"verdict": row.verdicts[observation_time]} | (asdict(answer) if answer else {})
        for observation_time, answer in row.answers.items()
    }


def _command(row: Row, settings: dict[str, Any]) -> str:
    """Recomputes a row with the same starts, beside the same readings."""
    quick = settings == asdict(replace(QUICK, seed=settings["seed"]))
    words = [row.claim.command, *(["--quick"] if quick else [])]
    words += [f"--seed {settings['seed']}"] if settings["seed"] != FULL.seed else []
    words += [f"--beside {' '.join(row.beside)}"] if row.beside else []
    return " ".join(words)


def _counts(verdicts: Sequence[str]) -> str:
    told = [f"{verdicts.count(one)} {one}" for one in ("agrees", "differs", NOT_SEARCHED) if one in verdicts]
    return ", ".join(told) or "none judged"


def _number(answer: Answer) -> str:
    if answer.value != answer.value:
        return f"no value at {answer.where}"
    interval = f" ({answer.low:.4f} to {answer.high:.4f})" if answer.low < answer.high else ""
    return f"{answer.value:.4f}{interval} at {answer.where}"
