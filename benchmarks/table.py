"""The figures of `make bench` as one table, each beside its bar and its peers, in the terminal and in Markdown.

    python -m benchmarks.table FOLDER

reads FOLDER/benchmark.json (pytest-benchmark) and writes FOLDER/table.md.
"""

import json
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from benchmarks.processor import clock, description, operations
from hexmj.files import write_text

COLUMNS = ["what", "hexmj", "bar", "peer", "ratio"]
ONE_CORE = "FLSS, LDVS, V = 0.1, one core"


def figure(benchmark: dict[str, Any]) -> float:
    """Amount per second of the median round, or its seconds, unless the test says its figure itself."""
    info, seconds = benchmark["extra_info"], benchmark["stats"]["median"]
    return info.get("figure") or (info["amount"] / seconds if info["amount"] else seconds)


def rows(benchmarks: list[dict[str, Any]]) -> list[list[str]]:
    """One row for each figure of ours and each of its peers; a ratio above 1 is in our favour."""
    lines = []
    for one in benchmarks:
        info, ours = one["extra_info"], figure(one)
        if info["who"] != "hexmj":
            continue
        more_is_better = info["unit"] not in ("s", "MB")
        met = "" if info["bar"] is None else _met(info["bar"], (ours >= info["bar"]) == more_is_better)
        row = [info["what"], f"{short(ours)} {info['unit']}", met]
        peers = [p for p in benchmarks if p["extra_info"]["what"] == info["what"] and p is not one]
        for peer in peers:
            theirs = figure(peer)
            ratio = ours / theirs if more_is_better else theirs / ours
            if info["ratio"] is not None and peer is peers[0]:
                row[2] = "ratio " + _met(info["ratio"], ratio >= info["ratio"])
            lines.append([*row, f"{peer['extra_info']['who']}: {short(theirs)}", short(ratio)])
            row = ["", "", ""]
        if not peers:
            lines.append([*row, "", ""])
    return lines


def short(number: float) -> str:
    """Three digits, without an exponent."""
    return f"{float(f'{number:.3g}'):,g}" if number < 1e6 else f"{number:,.0f}"


def _met(bar: float, met: bool) -> str:
    return f"{bar:g}, " + ("met" if met else "NOT MET")


def limit(benchmarks: list[dict[str, Any]]) -> str:
    """The processor's limit beside what the network reaches on one core, in a sentence."""
    rates = [figure(one) for one in benchmarks if one["extra_info"]["what"] == ONE_CORE]
    count, width = operations()
    if not (rates and count):
        return "The processor's limit needs the network's figure on one core, and a processor with AVX."
    rate, hertz = rates[0], clock()
    reached = rate * 1e6 * count / width / hertz
    return (
        f"The compiled kernel does {count} arithmetic operations for each start and step, {width} at a time, at a"
        f" measured clock of {hertz / 1e9:.2f} GHz: {rate:.0f} million start-steps/s on one core are {reached:.2f}"
        f" vector operations a cycle. With 4 a cycle, two multiplications and two additions, the most that a Zen 5"
        f" core can begin, it would be {4 * width * hertz / count / 1e6:.0f} million."
    )


def print_table(columns: list[str], lines: list[list[str]]) -> None:
    """A table in the terminal."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(escape(column), overflow="fold")
    for line in lines:
        table.add_row(*map(escape, line))
    Console(width=150, highlight=False).print(table)


def markdown(columns: list[str], lines: list[list[str]]) -> str:
    """The same in Markdown."""
    return "\n".join(f"| {' | '.join(line)} |" for line in [columns, ["---"] * len(columns), *lines]) + "\n"


def main(folder: str) -> None:
    """Print the table and write it."""
    benchmarks = json.loads((Path(folder) / "benchmark.json").read_text(encoding="utf-8"))["benchmarks"]
    lines, machine, sentence = rows(benchmarks), description(), limit(benchmarks)
    print_table(COLUMNS, lines)
    print(f"{machine}\n{sentence}")
    text = f"{machine}\n\n{markdown(COLUMNS, lines)}\n{sentence}\n"
    write_text(Path(folder) / "table.md", text)


if __name__ == "__main__":
    main(sys.argv[1])
