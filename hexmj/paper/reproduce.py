"""`hexmj reproduce`: measure, judge every claim of the paper, draw its figures; what is finished is kept."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from hexmj import io
from hexmj.controllers.cruse1998.model_variants import named_variant
from hexmj.errors import InputError
from hexmj.files import write_text
from hexmj.io import json_text, results_folder, save
from hexmj.measures.tables import VELOCITY
from hexmj.paper.claims import CLAIMS, Claim
from hexmj.paper.figures import FIGURES, SAMPLES
from hexmj.paper.protocol import FULL, MEASUREMENTS, Protocol, cells, velocities_of
from hexmj.paper.table import Row, claims_json, claims_markdown, judge
from hexmj.progress import part_of, shown
from hexmj.sweep import Execution, over_axes, run_cells
from hexmj.validate import distinct

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

TABLES = ("claims.md", "claims.json")
DRAWN: dict[str, dict[str, Any]] = {".pdf": {"metadata": {"CreationDate": None}}, ".png": {"dpi": 200}}
KEPT = "measurements"


def reproduce(
    out: Path, protocol: Protocol = FULL, only: Sequence[str] = (), beside: Sequence[str] = (), **how: Unpack[Execution]
) -> tuple[list[Row], list[Path]]:
    """Measure what the claims need, judge them, draw the figures.

    A stopped run goes on where it was: every measured velocity is kept in ``out/measurements``.  What lies in ``out``
    stays until all is measured.

    Args:
        out: folder for ``claims.md``, ``claims.json``, figures (PDF, PNG and their data as NetCDF) and measurements.
        protocol: how much is simulated.
        only: keys of the claims to judge, all unless given; figures are drawn only with all.
        beside: names of readings of the network under which the claims are judged, too.
        how: see `sweeps.Execution`.

    Returns:
        The rows in the paper's order, and the files written.

    Raises:
        InputError: a key that no claim has, a name that no reading has, samples that no figure draws, a folder that
            cannot be written to, or a damaged measurement.
    """
    if unknown := [key for key in only if key not in {claim.key for claim in CLAIMS}]:
        raise InputError(f"claim {unknown[0]!r}; valid keys: {', '.join(claim.key for claim in CLAIMS)}")
    if not only and protocol.samples != SAMPLES:
        raise InputError(f"samples = {protocol.samples}; expected {SAMPLES}, as the figures draw, or keys of claims")
    if beside:
        distinct("readings beside", beside)
    if "printed" in beside:
        raise InputError("reading 'printed' beside itself; expected others, beside which it stands anyway")
    model_variants = {name: named_variant(name) for name in beside}
    results_folder(out := Path(out))
    if not only:
        results_folder(out / "figures")
    claims = [claim for claim in CLAIMS if not only or claim.key in only]
    with shown(how.get("progress"), "reproducing") as progress:
        part = how | {"progress": part_of(progress, 1 / (1 + len(model_variants)))}
        measured = _measurements(_needed(claims, figures=not only), protocol, out / KEPT, part)
        rows = [judge(claim, measured) for claim in claims]
        for name, model_variant in model_variants.items():
            other = _measurements(
                _needed(claims, figures=False), replace(protocol, model_variant=model_variant), out / KEPT, part
            )
            rows = [
                replace(row, beside=row.beside | {name: judge(row.claim.under(model_variant), other)}) for row in rows
            ]
    texts = claims_markdown(rows, asdict(protocol)), json_text(claims_json(rows, asdict(protocol))) + "\n"
    files = [write_text(out / name, text) for name, text in zip(TABLES, texts, strict=True)]
    if not only:
        for name, (_, draw) in FIGURES.items():
            files += save_figure(*draw(measured), out / "figures" / name)
    return rows, files


def measure(name: str, protocol: Protocol, folder: Path | None = None, **how: Unpack[Execution]) -> "xr.Dataset":
    """One measurement of `MEASUREMENTS`, (velocity, ...); folder and `how` as of `sweeps.finish`."""
    return _over_velocities(name, protocol, run_cells(cells(name, protocol), folder, **how))


def _needed(claims: Sequence[Claim], figures: bool) -> list[str]:
    """Names of the measurements that claims, and the figures, are looked up in."""
    needed = {name for claim in claims for name in claim.rule.quantity.needs}
    if figures:
        needed |= {name for needs, _ in FIGURES.values() for name in needs}
    return [name for name in MEASUREMENTS if name in needed]


def _measurements(names: Sequence[str], protocol: Protocol, folder: Path, how: Execution) -> "dict[str, xr.Dataset]":
    """Measurements from one sweep over the velocities of all."""
    parts = {name: cells(name, protocol) for name in names}
    data = iter(run_cells([cell for part in parts.values() for cell in part], folder, **how))
    return {name: _over_velocities(name, protocol, [*islice(data, len(part))]) for name, part in parts.items()}


def _over_velocities(name: str, protocol: Protocol, rows: "Sequence[xr.Dataset]") -> "xr.Dataset":
    velocities = list(velocities_of(name, protocol))
    return over_axes({"velocity": len(velocities)}, rows, combine_attrs="drop").assign_coords(
        velocity=("velocity", velocities, VELOCITY)
    )


def save_figure(figure: "Figure", data: "xr.Dataset", path: Path) -> list[Path]:
    """Write a figure as PDF and PNG, and its data as NetCDF, under `path` with these endings."""
    files = [io.save_figure(figure, path.with_name(path.name + end)) for end in DRAWN]
    return [*files, save(data, path.with_name(path.name + ".nc"))]
