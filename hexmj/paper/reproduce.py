"""`hexmj reproduce`: measure what the paper's claims need, judge every claim, and draw the figures."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from hexmj import io
from hexmj.controllers.cruse1998 import named_variant
from hexmj.errors import InputError
from hexmj.files import write_text
from hexmj.measures.tables import VELOCITY
from hexmj.paper.claims import Answer, Claim, claims
from hexmj.paper.figures import FIGURES, SAMPLES
from hexmj.paper.protocol import FULL, MEASUREMENTS, Protocol, cells, searched_seeds
from hexmj.paper.quantities import Measured
from hexmj.progress import part_of, shown
from hexmj.sweep import Execution, over_axes, run_cells
from hexmj.timing import OBSERVATION_TIMES
from hexmj.validate import choice

if TYPE_CHECKING:
    import xarray as xr

MEASURED = "measurements"
"""Name of the directory of cached measurements, which is inside the results directory."""

NOT_SEARCHED = "not yet searched"  # verdict without a weight set

Answers = dict[str, Answer | None]
"""Observation time, or '' for gaits, which have none -> answer; None if the weight set was not searched yet."""


@dataclass(frozen=True)
class Row:
    """A claim and our answers: a row of the table."""

    claim: Claim
    answers: Answers
    beside: dict[str, Answers] = field(default_factory=dict)
    """Name of each further model variant -> answers under it."""

    @property
    def why(self) -> str:
        """Known reason for a difference; '' if every answer agrees."""
        return self.claim.why if "differs" in map(verdict, self.answers.values()) else ""

    def texts(self, short: bool = False) -> tuple[str, ...]:
        """Return the texts of the row in the table of claims; a short row has no kind, interval, place and reason.

        A short row marks a calibrated claim with *.
        """
        claim, answered = self.claim, []
        for answers in (self.answers, *self.beside.values()):
            texts = [_text(answer, short) for answer in answers.values()]
            answered += [*texts, "same"][: len(OBSERVATION_TIMES)]
        if short:
            return claim.section, claim.text + "*" * bool(claim.calibrates), claim.value, *answered
        kind = ": ".join(filter(None, (claim.kind, "; ".join(claim.calibrates))))
        return claim.key, claim.section, claim.text, claim.value, kind, *answered, self.why


def verdict(answer: Answer | None) -> str:
    """Return 'agrees', 'differs' or `NOT_SEARCHED`."""
    return NOT_SEARCHED if answer is None else "agrees" if answer.agrees else "differs"


def _text(answer: Answer | None, short: bool) -> str:
    """Return the text of an answer: verdict and value; unless it is short, also the 95 % interval and where."""
    if answer is None:
        return NOT_SEARCHED
    interval = f" ({answer.low:.4f} to {answer.high:.4f})" if answer.low < answer.high and not short else ""
    number = "no value" if answer.value != answer.value else f"{answer.value:.4f}{interval}"
    return f"{verdict(answer)}: {number}" + ("" if short else f" at {answer.where}")


@dataclass(frozen=True)
class Report:
    """Claims with our answers, and the paths of the written files."""

    rows: list[Row]
    protocol: Protocol
    files: list[Path] = field(default_factory=list)

    def table(self, short: bool = False) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the column heads and the rows of the table of claims, with a column for each model variant."""
        heads = tuple(f"{name}, {time}" for name in ("ours", *self.rows[0].beside) for time in OBSERVATION_TIMES)
        if short:
            heads = ("section", "the paper", "value", *(name.removeprefix("ours, ") for name in heads))
        else:
            heads = ("key", "section", "the paper", "its value", "kind", *heads, "why")
        return heads, [row.texts(short) for row in self.rows]

    @property
    def summary(self) -> list[str]:
        """Lines that count the verdicts, and warn if the weight sets were searched on these starts."""
        lines = summary(self.rows)
        if (seed := self.protocol.seed) in searched_seeds():
            lines.append(f"seed {seed}: the ideal sets were searched on these starts, so their FLSS is too low")
        for name in self.rows[0].beside:
            rows = [Row(row.claim, row.beside[name]) for row in self.rows]
            lines += [f"model variant {name}, {line}" for line in summary(rows)]
        return lines

    def markdown(self) -> str:
        """Return a Markdown document: the table, and the rule of every claim."""
        p, (heads, rows) = self.protocol, self.table()
        size = f"{p.samples} times {p.sample} starts, gaits from {p.gait_starts} starts"
        rows = [[cell.replace("differs:", "**differs**:") for cell in row] for row in rows]
        rules = [(row.claim.key, row.claim.judged_by) for row in self.rows]
        lines = [
            "# The claims of the 1998 paper",
            "",
            f"{size}; seed {p.seed}.  An answer is the value that is farthest from agreeing with the rule, its 95 %",
            "interval and where it occurs. `hexmj reproduce --only KEY` recomputes a claim.",
            "",
            *(f"- {sentence}" for sentence in self.summary),
            "",
            *io.markdown_table(heads, rows),
            "",
            "## Rules",
            "",
            *io.markdown_table(("key", "quantity and rule"), rules),
        ]
        return "\n".join(lines) + "\n"

    def json(self) -> dict[str, Any]:
        """Return claims, summary and protocol as plain data, which can be written as JSON."""
        rows = []
        for row in self.rows:
            claim = row.claim
            paper = {"key": claim.key, "section": claim.section, "paper": claim.text, "value": claim.value}
            paper |= {"kind": claim.kind, "calibrates": list(claim.calibrates), "why": claim.why}
            beside = {name: _plain(answers) for name, answers in row.beside.items()}
            rows.append(paper | {"rule": claim.judged_by, "ours": _plain(row.answers), "beside": beside})
        return {"claims": rows, "summary": self.summary, "protocol": asdict(self.protocol)}


def reproduce(
    out: Path | str,
    protocol: Protocol = FULL,
    only: Sequence[str] = (),
    beside: Sequence[str] = (),
    **execution: Unpack[Execution],
) -> Report:
    """Measure what the claims need, judge the claims and draw the figures.

    The measurement at each velocity is cached in `out`/measurements, so that an interrupted run resumes.

    Args:
        out: directory for claims.md, claims.json, figures (PDF, PNG and their data as NetCDF) and measurements.
        protocol: numbers of starts, velocities and further settings.
        only: keys of the claims to judge, without figures; empty for all claims, with figures.
        beside: names of further model variants under which the claims are judged.
        execution: see `sweep.Execution`.

    Raises:
        InputError: there is no such claim or model variant, or `protocol.samples` is not the number of the figures.
    """
    for key in only:
        choice("claim", key, claims())
    if not only and protocol.samples != SAMPLES:
        raise InputError(f"samples = {protocol.samples}; expected {SAMPLES}, which the figures need")
    variants = {name: replace(protocol, model_variant=named_variant(name)) for name in beside}
    out = Path(out)
    judged = [claim for key, claim in claims().items() if not only or key in only]
    needed = {name for claim in judged for name in claim.rule.quantity.needs}
    drawn = {} if only else FIGURES
    with shown(execution.get("progress"), "reproducing") as progress:
        how: Execution = execution | {"progress": part_of(progress, 1 / (1 + len(variants)))}
        names = needed | {name for needs, _ in drawn.values() for name in needs}
        measured = measure(names, protocol, out / MEASURED, **how)
        others = {name: measure(needed, variant, out / MEASURED, **how) for name, variant in variants.items()}
    rows = [Row(c, c.answers(measured), {name: c.answers(other) for name, other in others.items()}) for c in judged]
    report = Report(rows, protocol)
    report.files.append(write_text(out / "claims.md", report.markdown()))
    report.files.append(write_text(out / "claims.json", io.json_text(report.json()) + "\n"))
    for name, (_, draw) in drawn.items():
        figure, data = draw(measured.data)
        path = out / "figures" / name
        report.files.extend(io.save_figure(figure, path.with_name(name + end)) for end in (".pdf", ".png"))
        report.files.append(io.save(data, path.with_name(f"{name}.nc")))
    return report


def measure(names: set[str], protocol: Protocol, folder: Path | None = None, **how: Unpack[Execution]) -> Measured:
    """Compute the named `MEASUREMENTS` in one sweep; `folder` and `how` are arguments of `run_cells`."""
    parts = {name: cells(name, protocol) for name in MEASUREMENTS if name in names}
    results = iter(run_cells([cell for part in parts.values() for cell in part.values()], folder, **how))
    data: Mapping[str, xr.Dataset] = {
        name: over_axes({"velocity": len(part)}, [*islice(results, len(part))], combine_attrs="drop").assign_coords(
            velocity=("velocity", list(part), VELOCITY)
        )
        for name, part in parts.items()
    }
    return Measured(data, protocol.model_variant)


def summary(rows: Sequence[Row]) -> list[str]:
    """Return lines that count the verdicts, separately for held-out and calibrated claims."""
    lines = []
    for time in (*OBSERVATION_TIMES, ""):
        counts = []
        for kind in ("held out", "calibrated"):
            answers = [row.answers[time] for row in rows if time in row.answers and row.claim.kind == kind]
            found = Counter(map(verdict, answers))
            some = [f"{found[name]} {name}" for name in ("agrees", "differs", NOT_SEARCHED) if name in found]
            counts.append(f"{kind} {', '.join(some) or 'none judged'}")
        of = f"claims on FLSS and sets, observation time {time}" if time else "claims on gaits"
        lines.append(f"{of}: {'; '.join(counts)}")
    return lines


def _plain(answers: Answers) -> dict[str, dict[str, Any]]:
    """Return verdict and numbers for each observation time as plain data."""
    return {time or "any": {"verdict": verdict(a)} | (asdict(a) if a else {}) for time, a in answers.items()}
