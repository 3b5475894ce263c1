"""Tables, lines and JSON that the commands print, and the small files they write."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexmj.io import json_text

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from rich.table import Table


GAP = 2
"""Columns of the screen between those of a table."""


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
    return "; ".join(f"{key}: {value:{'.3g' if isinstance(value, float) else ''}}" for key, value in report.items())


def interval(one: "xr.Dataset", measure: str) -> str:
    flss, low, high = (one[measure + end].item() for end in ("", "_low", "_high"))
    return "-" if flss != flss else f"{flss:.3f} ({low:.2f}-{high:.2f})".replace("(0", "(").replace("-0", "-")


def four_digits(value: float) -> str:
    """A number to four digits, or to a whole one where it has more."""
    return f"{value:.0f}" if value >= 1000 else f"{value:.4g}"


def difference(one: "xr.Dataset", measure: str) -> str:
    """The same of a difference of two frequencies, with its signs."""
    middle, low, high = (one[measure + end].item() for end in ("", "_low", "_high"))
    return "-" if middle != middle else f"{middle:+.2f} ({low:+.2f} to {high:+.2f})".replace("0.", ".")


def save_figure(draw: "Callable[[xr.Dataset], Figure]", data: "xr.Dataset", path: Path) -> Path:
    """Draw some data and write the figure."""
    from hexmj.io import save_figure
    from hexmj.plotting import as_shipped

    with as_shipped():
        return save_figure(draw(data), path)


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> "Table":
    from rich import box
    from rich.table import Table

    made = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, show_edge=False)
    for column in head:
        made.add_column(column.replace("_", " "), overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def tables_that_fit(head: Sequence[str], rows: Sequence[Sequence[str]]) -> "Iterator[Table]":
    """A table as one or several below each other, each with the first column and as many others as the screen is wide;
    no cell is broken, unless it is wider than the screen."""
    from rich.console import Console

    wide = Console().width
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    parts, used = [[0]], widths[0]
    for column, width in enumerate(widths[1:], 1):
        if used + GAP + width > wide and len(parts[-1]) > 1:
            parts.append([0])
            used = widths[0]
        parts[-1].append(column)
        used += GAP + width
    for part in parts:
        yield table([head[column] for column in part], [[row[column] for column in part] for row in rows])


def show(*parts: Any) -> None:
    from rich.console import Console
    from rich.padding import Padding

    class Told(Console):
        def on_broken_pipe(self) -> None:  # where `main` says how it ends
            raise BrokenPipeError

    console = Told(highlight=False, soft_wrap=False, markup=False, emoji=False)
    for part in parts:
        console.print(part if isinstance(part, str) else Padding(part, (1, 0), expand=False))


def print_json(value: dict[str, Any]) -> None:
    print(json_text(value))
