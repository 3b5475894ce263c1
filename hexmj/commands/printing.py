"""Tables, lines and JSON that the commands print, and the small files they write."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexmj.parameters import Model
from hexmj.physics.body import Body
from hexmj.presets import model_toml
from hexmj.results import json_text, write_whole

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from rich.table import Table

    from hexmj.cli import Conditions


TOLD = ("vp", "step_height", "standing_height", "lift_time", "landing_time", "friction", "contact_gap")
"""Conditions of a body that stand beside every physical measure; the others only if they are not the usual ones."""


def physical_report(result: "xr.Dataset") -> dict[str, float]:
    """How far the bodies did what they were told, over all walks of a comparison or a physical FLSS."""
    return {
        "mean slip [mm/s]": result.slip.mean().item(),
        "tracking, 95th percentile [mm]": result.tracking.mean().item(),
        "deepest foot in the ground [mm]": result.depth.max().item(),
        "joints at their torque limit": result.saturation.mean().item(),
        "tip targets out of reach": result.unreachable.sum().item(),
        "least clearance [mm]": result.clearance.min().item(),
        "greatest tilt [rad]": result.tilt.max().item(),
    }


def report_line(report: dict[str, float]) -> str:
    return "; ".join(f"{key}: {value:.3g}" for key, value in report.items())


def conditions_line(conditions: "Conditions", physical: bool, varied: tuple[str, ...] = ()) -> str:
    """The conditions that stand beside every measure, but for those that were `varied`."""
    line = f"window {conditions.window} (t in time units); seed {conditions.seed}"
    if conditions.acceleration is not None:
        line += f"; a = {conditions.acceleration:g} from V = {conditions.initial_velocity:g}"
    if physical:
        told, usual = asdict(conditions.body), asdict(Body())
        shown = (key for key in told if (key in TOLD or told[key] != usual[key]) and key not in varied)
        line += "; " + ", ".join(f"{key} {told[key]}" for key in shown)
    return line


def interval(one: "xr.Dataset", measure: str) -> str:
    flss, low, high = (one[measure + end].item() for end in ("", "_low", "_high"))
    return f"{flss:.3f} ({low:.2f}-{high:.2f})".replace("(0", "(").replace("-0", "-")


def short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def save_figure(figure: "Figure", path: Path) -> Path:
    return write_whole(path, lambda part: figure.savefig(part, dpi=150))


def save_model(model: Model, comment: str, path: Path) -> Path:
    """A TOML file that `load_model` reads to the same bits."""
    return write_whole(path, lambda part: part.write_text(f"# {comment}\n{model_toml(model)}", encoding="utf-8"))


def new_table(*columns: str) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in columns:
        table.add_column(column.replace("_", " "), overflow="fold")
    return table


def show(*parts: Any) -> None:
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    for part in parts:
        console.print(part, markup=False) if isinstance(part, str) else console.print(part)


def print_json(value: dict[str, Any]) -> None:
    print(json_text(value))
