"""Write the tables and figures of pages with results: `python docs/results.py [FOLDER]`, by default `results`.

`make results` computes what it reads. The table of a page stands between two comments; the text around it is written by
hand and quotes the table. A page without results in the folder stays as it is.
"""

import json
import re
import shutil
import sys
from collections.abc import Sequence
from itertools import groupby, product
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import hexmj
from hexmj import io
from hexmj.measures.figures import UNITS, caption
from hexmj.measures.tables import happened
from hexmj.paper.claims import claims
from hexmj.plotting import MEASURE_STYLES, as_shipped, head, picture
from hexmj.stats import paired_difference
from hexmj.studies.biology import ANIMALS, table_rows, walked_in_words
from hexmj.tasks.league import frequency, matrix_rows, two_digits

PAGES = Path(__file__).parent
IMAGES = Path(__file__).parent / "images"
BEGIN, END = "<!-- table -->\n", "<!-- end of the table -->"
SEED, N_STARTS = 1998, 7000
"""Random starts of `hexmj reproduce`, from which the FLSS of our own weight sets is computed too."""

NETWORK = re.compile(r", (HWS|LDVS)$")
VARIED = re.compile(r", (front|middle|hind)\b| at (\d+ mm/s)")
"""Part of a quantity's name in which neighbouring rows of `hexmj biology` differ; such rows become one."""


def table(head: str, rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table without blanks around its cells; the cells of the head are separated by '|'."""
    cells = [head.split("|"), ["---"] * (head.count("|") + 1), *rows]
    return "".join(f"|{'|'.join(cell.replace('|', chr(92) + '|') for cell in row)}|\n" for row in cells)


def number(value: float, low: float, high: float) -> str:
    """Return a value with its 95 % interval, three digits after the point."""
    texts = [f"{x:.3f}".replace("-0.000", "0.000") for x in (value, low, high)]
    return "no value" if value != value else texts[0] + (f" ({texts[1]} to {texts[2]})" if texts[1] != texts[2] else "")


def alike(texts: Sequence[str]) -> str:
    """Return texts as one cell, or one of them if all are the same; intervals without a minus become shorter."""
    text = "; ".join({*texts} if len({*texts}) == 1 else texts)
    return re.sub(r"(?<![-\d.])([\d.]+) to (?=\d)", r"\1-", text)


def paper(folder: Path) -> list[str]:
    """Return tables of agreeing claims, all claims and our own weight sets, and copy figures of `hexmj reproduce`."""
    answers = json.loads((folder / "claims.json").read_text(encoding="utf-8"))["claims"]
    for name, drawn in {"paper_flss": "figure-4-walk", "paper_phases": "figure-5"}.items():
        shutil.copyfile(folder / "figures" / f"{drawn}.png", IMAGES / f"{name}.png")
    return [_agreeing(answers), _claims(answers), _own_sets()]


def _agreeing(answers: list[dict[str, Any]]) -> str:
    counts = []
    for variant, time in (("", "walk"), ("", "start"), ("lasting", "walk"), ("lasting", "start")):
        agree = [claim for claim in answers if _answer(claim, time, variant)["verdict"] == "agrees"]
        held_out, of = (sum(claim["kind"] == "held out" for claim in some) for some in (agree, answers))
        counts.append([variant or "printed", time, f"{held_out} of {of}", f"{len(agree)} of {len(answers)}"])
    return table("model variant|observation time|held-out claims that agree|all claims that agree", counts)


def _claims(answers: list[dict[str, Any]]) -> str:
    """Return the table of claims; neighbours that differ in the network alone, ', HWS' and ', LDVS', are one row."""
    rows, before, known = [], "", claims()
    for (section, text, printed), group in groupby(
        answers, lambda one: (one["section"], NETWORK.sub("", known[one["key"]].text), one["value"])
    ):
        both, values, wheres, verdicts, why = [*group], [], [], [], ""
        for one in both:
            claim, ours = known[one["key"]], _answer(one, "walk")
            said = number(*(nan if ours[key] is None else ours[key] for key in ("value", "low", "high")))
            values.append(f"{claim.text.rpartition(', ')[2]} {said}" if len(both) > 1 else said)
            wheres.append(re.sub(r"(.+), mean to ", r"mean, \1-", ours["where"].removeprefix("V = ")))
            agrees = ours["verdict"] == "agrees"
            verdicts.append(("agrees" if agrees else "**differs**") + "\\*" * bool(claim.calibrates))
            why = why if agrees else claim.why or "unknown"
        text = text if len(both) > 1 else known[both[0]["key"]].text
        again = "as above" if why == before else why
        rows.append([section, text, printed, *map(alike, (values, wheres, verdicts)), again if why else ""])
        before = why or before
    return table("section|claim|paper|hexmj|at V|verdict|reason", rows)


def _answer(claim: dict[str, Any], time: str, variant: str = "") -> dict[str, Any]:
    """Return the answer to a claim for an observation time; claims on gaits have one answer for both."""
    answers = claim["beside"][variant] if variant else claim["ours"]
    return answers.get(time) or answers["any"]


def _own_sets() -> str:
    rows = []
    for v in np.linspace(0.1, 0.9, 9).round(1).tolist():
        names = "uncoordinated", "hws", "ldvs", "own", f"own-{v}"
        every = [hexmj.flss(hexmj.load_controller(name), [v], n_starts=N_STARTS, seed=SEED) for name in names]
        rows.append([f"{v}", *(f"{one.flss.item():.4f}" for one in every)])
    return table("V|uncoordinated|HWS|LDVS|`own`|`own-V`", rows)


def league(folder: Path) -> list[str]:
    """Return falls in all tasks, and margins and costs in some, and draw the figures of the league."""
    result = io.load(folder / "league.nc")
    with as_shipped():
        for view, name in {"matrix": "league", "cost": "league_cost"}.items():
            io.save_figure(hexmj.plot(result, view), IMAGES / f"{name}.png")
    tasks = result.task.values.tolist()
    first = table("|".join(("controller", *tasks)), matrix_rows(result))
    columns = [("slow", "margin"), ("fast", "margin"), ("slow", "cost"), ("fast", "cost")]
    columns += [("curve", "path_distance"), ("turn", "heading_error"), ("push", "recovery")]
    rows = [
        [name, *(two_digits(result[key].sel(task=task, controller=name).item()) for task, key in columns)]
        for name in result.controller.values.tolist()
    ]
    heads = "controller|margin, slow|margin, fast|cost, slow|cost, fast|off path, curve [mm]|heading, turn [rad]"
    return [first, table(f"{heads}|recovery, push", rows)]


def biology(folder: Path) -> list[str]:
    """Return the rows with a figure of insects, and draw the figure."""
    result = io.load(folder / "biology.nc")
    with as_shipped():
        io.save_figure(hexmj.plot(result), IMAGES / "biology.png")
    for name in ("steps", "recovery"):
        shutil.copyfile(folder.parent / f"insects/{name}.png", IMAGES / f"{name}.png")
    known = [row for row in table_rows(result) if row[2] != "-"]
    rows = []
    for (name, source), group in groupby(known, lambda row: (VARIED.sub("", row[0]), row[4])):
        each = [*group]
        varied = [found[1] or found[2] for row in each if (found := VARIED.search(row[0]))]
        values, insects, verdicts = map(alike, [*zip(*each, strict=True)][1:4])
        rows.append([f"{name}{': ' * bool(varied)}{', '.join(varied)}", values, insects, verdicts, source])
    without = len(ANIMALS) - len(known)
    note = f"\n{without} more rows have no figure of insects. Whole strides: {walked_in_words(result)}.\n"
    return [table("quantity|hexmj (95 %)|insects|verdict|source", rows) + note]


def sensitivity(folder: Path) -> list[str]:
    """Return the falls with one condition changed at a time, and their differences to the defaults."""
    rows = [["defaults", "", "", ""]]
    for path in sorted(folder.parent.glob("*/comparison.nc")):
        option, result = path.parent.name, io.load(path).isel(controller=0, velocity=0)
        default = getattr(hexmj.Conditions(), name := option.replace("-", "_"))
        rows[0][2] = frequency(result.sel({name: default}), "physical")
        fell, unit = happened(result.fall), f"{default:g} {UNITS.get(name, '')}".strip()
        for value in result[name].values[result[name] != default]:
            change = paired_difference(fell.sel({name: value}).values, fell.sel({name: default}).values)
            text = "{:+.2f} ({:+.2f} to {:+.2f})".format(*change).replace("0.", ".")
            rows.append([f"`--{option} {value:g}`", unit, frequency(result.sel({name: value}), "physical"), text])
    return [table("option|default|falls|difference", rows)]


def dynamic(folder: Path) -> list[str]:
    """Return FLDS and falls over V and V_p with their agreement start by start, and draw all measures over V."""
    with as_shipped():
        io.save_figure(hexmj.plot(io.load(folder.parent / "over_v/comparison.nc")), IMAGES / "dynamic.png")
        _draw_prediction(io.load(folder.parent / "everyone/comparison.nc").isel(velocity=0))
    measures, rows = ("kinematic", "dynamic", "physical"), []
    result = io.load(folder / "comparison.nc").isel(controller=0)
    for v, vp in product(result.velocity.values, result.vp.values):
        cell = result.sel(velocity=v, vp=vp)
        predicted = happened(cell.dynamic_loss), happened(cell.planned_loss)
        agree = [f"{(lost == happened(cell.fall)).mean().item():.2f}" for lost in predicted]
        rows.append([f"{v:g}", f"{vp:g}", *(frequency(cell, name) for name in measures), *agree])
    return [table("V|V_p [mm/s]|kinematic FLSS|FLDS|falls|agreement, FLDS|agreement, FLSS", rows)]


def _draw_prediction(result: Any) -> None:
    """Draw the frequency of falls over FLDS and kinematic FLSS at one velocity, a point for each controller."""
    figure, away = picture(7.0, 6.0), {}
    axes = figure.subplots()
    axes.axline((0.0, 0.0), slope=1.0, color="0.6", linewidth=1.0)
    for measure, colour, fill in (("kinematic", "#1b6ca8", "none"), ("dynamic", "#2b2b2b", "#2b2b2b")):
        look: Any = {"color": colour, "mfc": fill, "label": MEASURE_STYLES[measure]["label"], "linestyle": "none"}
        axes.plot(result[measure], result.physical, marker=MEASURE_STYLES[measure]["marker"], **look)
        away[measure] = float(abs(result[measure] - result.physical).mean())
    axes.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), aspect="equal")
    axes.set(xlabel="frequency of losses in the plan", ylabel="frequency of falls")
    axes.legend(loc="upper left", frameon=False, fontsize=9)
    finding = "mean distance from the frequency of falls: FLDS {dynamic:.3f}, kinematic FLSS {kinematic:.3f}"
    head(figure, finding.format(**away), caption(result))
    io.save_figure(figure, IMAGES / "prediction.png")


def speed(folder: Path) -> list[str]:
    """Return the ratios of `make bench`, without the speeds of the machine."""
    lines = (folder / "table.md").read_text(encoding="utf-8").splitlines()
    if (folder / "scaling.png").exists():
        shutil.copyfile(folder / "scaling.png", IMAGES / "scaling.png")
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[4:]]
    rows = [[what, peer.rpartition(": ")[0], ratio] for what, _, _, peer, ratio in cells]
    return [table("what|peer|ratio", rows)]


def main() -> None:
    """Write every page whose results are in the folder."""
    results = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
    files = {paper: "reproduce/claims.json", league: "league/league.nc", biology: "biology/biology.nc"}
    files |= {speed: "bench/table.md", sensitivity: "sensitivity/vp/comparison.nc", dynamic: "dynamic/comparison.nc"}
    pages = {sensitivity: "concepts/physics.md", dynamic: "concepts/dynamic.md"}
    for write, name in files.items():
        page = PAGES / pages.get(write, f"results/{write.__name__}.md")
        if not (results / name).exists():
            print(f"{page.name} stays: {results / name} does not exist")
            continue
        tables = iter(write((results / name).parent))
        before, *parts = page.read_text(encoding="utf-8").split(BEGIN)
        olds = [part.partition(END) for part in parts]
        text = before + "".join(BEGIN + next(tables, old) + END + rest for old, _, rest in olds)
        page.write_text(text, encoding="utf-8")
        print(f"{page.name}: {len(text.split())} words")
    for path in IMAGES.glob("*.png"):  # 192 colours make a figure three times smaller
        if (image := Image.open(path)).mode != "P":
            image.convert("RGB").quantize(192, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
