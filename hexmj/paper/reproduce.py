"""`hexmj reproduce`: measure, judge every claim of the paper, draw its figures."""

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
from hexmj.paper.claims import Answer, Claim, claims, in_physics
from hexmj.paper.figures import FIGURES, SAMPLES
from hexmj.paper.protocol import FULL, MEASUREMENTS, Protocol, Reproduction, cells, searched_seeds
from hexmj.paper.quantities import Measured
from hexmj.progress import part_of, shown
from hexmj.sweep import Execution, over_axes, run_cells
from hexmj.timing import OBSERVATION_TIMES
from hexmj.validate import choice

if TYPE_CHECKING:
    import xarray as xr

MEASURED = "measurements"
"""Directory of the cached measurements, beside the results."""

NOT_SEARCHED = "not yet searched"

Answers = dict[str, Answer | None]
"""Answers by observation time, or one under '' if it does not matter; None if a set has not been searched yet."""


@dataclass(frozen=True)
class Row:
    """A claim with our answers."""

    claim: Claim
    answers: Answers
    beside: dict[str, Answers] = field(default_factory=dict)
    """The answers under other model variants, by name."""

    @property
    def fits(self) -> str:
        """The observation time that the paper's number fits, 'both' or 'neither'; empty if that is not the question."""
        if set(self.answers) == {""} or None in self.answers.values():
            return ""
        agreeing = [time for time, answer in self.answers.items() if answer and answer.agrees]
        return "both" if len(agreeing) == len(OBSERVATION_TIMES) else next(iter(agreeing), "neither")

    @property
    def why(self) -> str:
        """The known reason, if we differ."""
        return self.claim.why if "differs" in map(verdict, self.answers.values()) else ""

    @property
    def cells(self) -> tuple[str, ...]:
        """The row as texts: the paper's words, the answers under all variants and observation times, fits and why."""
        claim, cells = self.claim, []
        for answers in (self.answers, *self.beside.values()):
            cells += [*map(_cell, answers.values()), "same"][: len(OBSERVATION_TIMES)]
        kind = "; ".join(claim.calibrates)
        kind = f"{claim.kind}: {kind}" if kind else claim.kind
        return claim.section, claim.text, claim.value, kind, *cells, self.fits, self.why


def verdict(answer: Answer | None) -> str:
    """Return 'agrees', 'differs' or that a set has not been searched yet."""
    return NOT_SEARCHED if answer is None else "agrees" if answer.agrees else "differs"


def _cell(answer: Answer | None) -> str:
    """Return verdict and number."""
    if answer is None:
        return NOT_SEARCHED
    interval = f" ({answer.low:.4f} to {answer.high:.4f})" if answer.low < answer.high else ""
    number = "no value" if answer.value != answer.value else f"{answer.value:.4f}{interval}"
    return f"{verdict(answer)}: {number} at {answer.where}"


@dataclass(frozen=True)
class Report:
    """The claims with our answers, and the files that were written."""

    rows: list[Row]
    protocol: Protocol
    files: list[Path] = field(default_factory=list)

    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the heads and rows of a table of our answers, under other model variants too."""
        names = ("ours", *self.rows[0].beside)
        answers = (f"{name}, {time}" for name in names for time in OBSERVATION_TIMES)
        heads = "section", "the paper", "its value", "kind", *answers, "fits", "why"
        return heads, [row.cells for row in self.rows]

    @property
    def summary(self) -> list[str]:
        """Sentences that count the verdicts, and say if the starts are those of the searches."""
        lines = summary(self.rows)
        if (seed := self.protocol.seed) in searched_seeds():
            lines.append(f"seed {seed}: ideal sets were searched on these starts, where they look better than they are")
        for name in self.rows[0].beside:
            rows = [Row(row.claim, row.beside[name]) for row in self.rows]
            lines += [f"model variant {name}, {line}" for line in summary(rows)]
        return lines

    def markdown(self) -> str:
        """Return the table, the rule of every row, and the command that recomputes it."""
        p, (heads, rows) = self.protocol, self.table()
        size = f"{p.samples} times {p.sample} starts, gaits from {p.gait_starts} starts"
        head = f"{size}; seed {p.seed}.  An answer is the number that strains the rule most, with its 95 % interval,"
        rows = [[cell.replace("differs:", "**differs**:") for cell in row] for row in rows]
        rules = [(row.claim.text, row.claim.rule.words, f"`{self.command(row)}`") for row in self.rows]
        lines = [
            "# The claims of the 1998 paper", "", f"{head} and where.", "",
            *(f"- {sentence}" for sentence in self.summary), "",
            *io.markdown_table(heads, rows), "", "## Rules and commands", "",
            *io.markdown_table(("the paper", "agrees if", "command"), rules), "",
            "## Judged in physics", "", "Plans cannot answer these; docs/experiments.md does.", "",
            *(f"- {one['topic']} (Section 6): {one['text']}; `{one['command']}`" for one in in_physics()),
        ]  # fmt: skip
        return "\n".join(lines) + "\n"

    def json(self) -> dict[str, Any]:
        """Return the same as plain numbers and texts."""
        rows = []
        for row in self.rows:
            claim, beside = row.claim, {name: _plain(answers) for name, answers in row.beside.items()}
            paper = {"key": claim.key, "section": claim.section, "paper": claim.text, "value": claim.value}
            paper |= {"kind": claim.kind, "calibrates": list(claim.calibrates)}
            how = {"rule": claim.rule.words, "fits": row.fits, "why": claim.why, "command": self.command(row)}
            rows.append(paper | {"ours": _plain(row.answers), "beside": beside} | how)
        return {"claims": rows, "summary": self.summary, "protocol": asdict(self.protocol)}

    def command(self, row: Row) -> str:
        """Return the command that recomputes a row with the same starts and model variants."""
        seed = self.protocol.seed
        words = ["hexmj reproduce --only", row.claim.key]
        words += ["--quick"] if self.protocol == Reproduction(quick=True, seed=seed).protocol else []
        words += [f"--seed {seed}"] if seed != FULL.seed else []
        words += ["--beside", *row.beside] if row.beside else []
        return " ".join(words)


def reproduce(
    out: Path | str,
    protocol: Protocol = FULL,
    only: Sequence[str] = (),
    beside: Sequence[str] = (),
    **execution: Unpack[Execution],
) -> Report:
    """Measure what the claims need, judge them and draw the figures.

    Every measured velocity is cached in `out`/measurements, so that a run that was stopped resumes.

    Args:
        out: directory for claims.md, claims.json, figures (PDF, PNG and their data as NetCDF) and measurements.
        protocol: how much is simulated.
        only: keys of the claims to judge, without figures; by default all.
        beside: names of model variants under which the claims are judged too.
        execution: see `sweep.Execution`.

    Raises:
        InputError: no such claim or model variant, or a number of samples that the figures do not draw.
    """
    for key in only:
        choice("claim", key, claims())
    if not only and protocol.samples != SAMPLES:
        raise InputError(f"samples = {protocol.samples}; the figures draw {SAMPLES}")
    variants = {name: named_variant(name) for name in beside}
    out = io.results_folder(out)
    judged = [claim for key, claim in claims().items() if not only or key in only]
    needed = {name for claim in judged for name in claim.rule.quantity.needs}
    drawn = {} if only else FIGURES
    with shown(execution.get("progress"), "reproducing") as progress:
        how: Execution = execution | {"progress": part_of(progress, 1 / (1 + len(variants)))}
        names = needed | {name for needs, _ in drawn.values() for name in needs}
        measured = measure(names, protocol, out / MEASURED, **how)
        others = {
            name: measure(needed, replace(protocol, model_variant=variant), out / MEASURED, **how)
            for name, variant in variants.items()
        }
    rows = [
        Row(claim, claim.answers(measured), {name: claim.answers(other) for name, other in others.items()})
        for claim in judged
    ]
    report = Report(rows, protocol)
    report.files.append(write_text(out / "claims.md", report.markdown()))
    report.files.append(write_text(out / "claims.json", io.json_text(report.json()) + "\n"))
    for name, (_, draw) in drawn.items():
        figure, data = draw(measured.data)
        path = io.results_folder(out / "figures") / name
        report.files.extend(io.save_figure(figure, path.with_name(name + end)) for end in (".pdf", ".png"))
        report.files.append(io.save(data, path.with_name(f"{name}.nc")))
    return report


def measure(
    names: set[str] | Sequence[str],
    protocol: Protocol,
    folder: Path | str | None = None,
    **execution: Unpack[Execution],
) -> Measured:
    """Take measurements of `MEASUREMENTS` in one sweep over the velocities of all; arguments as of `run_cells`."""
    parts = {name: cells(name, protocol) for name in MEASUREMENTS if name in names}
    results = iter(run_cells([cell for part in parts.values() for cell in part.values()], folder, **execution))
    data: Mapping[str, xr.Dataset] = {
        name: over_axes({"velocity": len(part)}, [*islice(results, len(part))], combine_attrs="drop").assign_coords(
            velocity=("velocity", list(part), VELOCITY)
        )
        for name, part in parts.items()
    }
    return Measured(data, protocol.model_variant)


def summary(rows: Sequence[Row]) -> list[str]:
    """Return sentences that count the verdicts, those of calibrated claims separately."""
    lines = []
    for time in (*OBSERVATION_TIMES, ""):
        counts = []
        for kind in ("held out", "calibrated"):
            answers = [row.answers[time] for row in rows if time in row.answers and row.claim.kind == kind]
            found = Counter(map(verdict, answers))
            some = [f"{found[one]} {one}" for one in ("agrees", "differs", NOT_SEARCHED) if one in found]
            counts.append(f"{kind} {', '.join(some) or 'none judged'}")
        of = f"claims on FLSS and sets, observation time {time}" if time else "claims on gaits"
        lines.append(f"{of}: {'; '.join(counts)}")
    fits = Counter(row.fits for row in rows)
    counts = ", ".join(f"{name} {fits[name]}" for name in ("both", *OBSERVATION_TIMES, "neither"))
    return [*lines, f"which observation time the paper's numbers fit: {counts}"]


def _plain(answers: Answers) -> dict[str, dict[str, Any]]:
    """Return verdicts and numbers by observation time."""
    return {
        time or "any": {"verdict": verdict(answer)} | (asdict(answer) if answer else {})
        for time, answer in answers.items()
    }
