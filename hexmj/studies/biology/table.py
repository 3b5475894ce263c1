"""The animal beside the machine as a table: texts, and Markdown with the sources."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from hexmj.io import markdown_table
from hexmj.measures.drawable_parts import check_axes, what_parts_may_lack
from hexmj.studies.biology.animals import SOURCES
from hexmj.studies.biology.study import walked_in_words

if TYPE_CHECKING:
    import xarray as xr

HEADS = ("quantity", "ours (95 %)", "insects", "verdict on the mean", "source")


def rows(result: "xr.Dataset") -> Iterator[tuple[str, ...]]:
    """The cells of each row of a result of `Biology`, under `HEADS`."""
    for n in range(result.sizes["row"]):
        row = {name: result[name].values[n] for name in result.data_vars if result[name].dims == ("row",)}
        at = f" at {row['at']:g} mm/s" if row["depends"] else ""
        unit = f" [{row['unit']}]" if row["unit"] != "1" else ""
        several = row["low"] < row["high"]  # starts
        ours = _range(row["mean"], row["mean"]) + (f" ({row['low']:.3g} to {row['high']:.3g})" if several else "")
        built_in = ", built in" if row["built_in"] else ""
        insects = _range(row["animal_low"], row["animal_high"])
        yield f"{row['name']}{at}{unit}", ours, insects, f"{row['verdict']}{built_in}", row["source"]


def biology_markdown(result: "xr.Dataset") -> str:
    """The table, and the sources it names.

    Raises:
        InputError: a part of a result that holds too little.
    """
    check_axes(result)
    with what_parts_may_lack(result, "the table of insects cannot be made"):
        lines = [*markdown_table(HEADS, rows(result)), "", f"Starts with whole strides: {walked_in_words(result)}.", ""]
        named = {*result.source.values}
    return (
        "\n".join([*lines, *(f"- {name}: {text}" for name, text in SOURCES.items() if name in named and text)]) + "\n"
    )


def _range(low: float, high: float) -> str:
    """From least to greatest; "-" where it is not known."""
    if math.isnan(low):
        return "-"
    if math.isinf(low) or math.isinf(high):
        return f"above {low:.3g}" if math.isinf(high) else f"below {high:.3g}"
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
