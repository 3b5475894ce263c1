"""`hexmj reproduce`: measure, judge every claim of the paper, draw its figures; what is finished is kept."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from hexmj.cells import kept
from hexmj.errors import InputError
from hexmj.paper.claims import CLAIMS, Claim
from hexmj.paper.figures import FIGURES
from hexmj.paper.protocol import COSTS, FULL, MEASUREMENTS, Protocol
from hexmj.paper.table import Row, claims_json, claims_markdown, judge
from hexmj.progress import Progress
from hexmj.results import json_text, results_folder, save_dataset, write_whole

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

TABLES = ("claims.md", "claims.json")
KEPT = "measurements"


def reproduce(
    out: Path,
    protocol: Protocol = FULL,
    *,
    only: Sequence[str] = (),
    progress: Progress | None = None,
) -> tuple[list[Row], list[Path]]:
    """Measure what the claims need, judge them, draw the figures.

    A stopped run goes on where it was: every measured velocity is kept in ``out/measurements``, and the tables are
    written anew after each measurement, with the rows that can be judged by then.

    Args:
        out: folder for ``claims.md``, ``claims.json``, figures (PDF, PNG and their data as NetCDF) and measurements.
        protocol: how much is simulated.
        only: keys of the claims to judge, all unless given; figures are drawn only with all.
        progress: told the fraction of the work that has been done since the last call.

    Returns:
        The rows in the paper's order, and the files written.

    Raises:
        InputError: a key that no claim has, a folder that cannot be written to, or a damaged measurement.
    """
    if unknown := [key for key in only if key not in {claim.key for claim in CLAIMS}]:
        raise InputError(f"claim {unknown[0]!r}; valid keys: {', '.join(claim.key for claim in CLAIMS)}")
    results_folder(out, TABLES)
    claims = [claim for claim in CLAIMS if not only or claim.key in only]
    needed = {name for claim in claims for name in claim.rule.quantity.needs}
    if not only:
        needed |= {name for needs, _ in FIGURES.values() for name in needs}
    names = [name for name in MEASUREMENTS if name in needed]
    total = sum(COSTS.get(name, 1.0) for name in names)
    measured: dict[str, xr.Dataset] = {}
    judged: dict[str, Row] = {}
    files = _judge_ready(out, claims, measured, judged, protocol)
    for name in names:
        part = COSTS.get(name, 1.0) / total
        told = progress and (lambda done, part=part: progress(part * done))
        measured[name] = measure(name, protocol, out / KEPT, told)
        files = _judge_ready(out, claims, measured, judged, protocol)
    if not only:
        for name, (_, draw) in FIGURES.items():
            files += save_figure(*draw(measured), out / "figures" / name)
    return _rows(claims, judged), files


def measure(name: str, protocol: Protocol, folder: Path, progress: Progress | None = None) -> "xr.Dataset":
    """One measurement of `MEASUREMENTS`, (velocity, ...); the rows that `folder` holds are not walked again.

    A row's file is named by all that its outcomes depend on, so none is ever overwritten or mistaken for another.

    Args:
        name: of the measurement.
        protocol: how much is simulated.
        folder: keeps a file for each velocity, written as soon as it is finished.
        progress: told the fraction of the measurement that has been done since the last call.

    Raises:
        InputError: a kept row is damaged.
    """
    import xarray as xr

    measurement = MEASUREMENTS[name]
    rows: list[xr.Dataset] = []
    velocities = measurement.velocities(protocol)
    for v in velocities:
        settings = {"measurement": name, "velocity": v} | measurement.settings(v, protocol)
        rows.append(kept(folder, f"{name}-{v:g}", settings, lambda v=v: measurement.at(v, protocol)))
        if progress:
            progress(1 / len(velocities))
    return xr.concat(rows, xr.DataArray(list(velocities), dims="velocity", name="velocity"), combine_attrs="drop")


def save_figure(figure: "Figure", data: "xr.Dataset", path: Path) -> list[Path]:
    """Write a figure as PDF and PNG, and its data as NetCDF, under `path` with these endings."""
    options = {".pdf": {"metadata": {"CreationDate": None}}, ".png": {"dpi": 200}}
    files = [
        write_whole(path.with_name(path.name + end), lambda part, how=how: figure.savefig(part, **how))
        for end, how in options.items()
    ]
    return [*files, save_dataset(data, path.with_name(path.name + ".nc"))]


def _judge_ready(
    out: Path,
    claims: Sequence[Claim],
    measured: Mapping[str, "xr.Dataset"],
    judged: dict[str, Row],
    protocol: Protocol,
) -> list[Path]:
    """Judge the claims whose measurements are there, and write all that are judged into both tables."""
    for claim in claims:
        if claim.key not in judged and set(claim.rule.quantity.needs) <= set(measured):
            judged[claim.key] = judge(claim, measured)
    rows, settings = _rows(claims, judged), asdict(protocol)
    texts = claims_markdown(rows, settings), json_text(claims_json(rows, settings)) + "\n"
    return [
        write_whole(out / name, lambda part, text=text: part.write_text(text, encoding="utf-8"))
        for name, text in zip(TABLES, texts, strict=True)
    ]


def _rows(claims: Sequence[Claim], judged: Mapping[str, Row]) -> list[Row]:
    """What has been judged, in the paper's order."""
    return [judged[claim.key] for claim in claims if claim.key in judged]
