"""What is shown of results in a line, in a notebook and by help()."""

import re
import xml.etree.ElementTree as Xml
from pathlib import Path

import numpy as np
import pytest

import hexmj
from hexmj.gaits import Gait, steady_state_gait
from hexmj.legs import LEGS
from hexmj.walks import spans

STARTS = hexmj.draw_starts(3, seed=1)
MODULES = {
    ".".join(path.relative_to(Path(hexmj.__file__).parent).with_suffix("").parts).removesuffix(".__init__")
    for path in Path(hexmj.__file__).parent.rglob("*.py")
}


@pytest.fixture(scope="module")
def walked() -> hexmj.PhysicalWalk:
    return hexmj.physical_walk(STARTS, hexmj.UNCOORDINATED, [0.3, 0.5, 0.6], 60.0)


@pytest.fixture(scope="module")
def found() -> Gait:
    return steady_state_gait(hexmj.HWS, 0.6, n_starts=3, stride=hexmj.Stride(dt=0.05), periods=30)


def test_results_say_what_they_are_in_a_line(walked: hexmj.PhysicalWalk, found: Gait):
    fell = int(np.isfinite(walked.outcomes.fall).sum())
    assert repr(walked.planned) == "PlannedWalk(600 steps to t = 60 time units, 3 starts, V = 0.3 to 0.6)"
    assert repr(walked.measured).startswith("Walk(600 steps")
    assert repr(walked).startswith("PhysicalWalk(600 steps to t = 60 time units, 3 starts, V = 0.3 to 0.6; Outcomes(")
    assert f"fell {fell}" in repr(walked.outcomes)
    assert re.match(r"Gait\(of 3: periodic \d, stable \d", repr(found))
    for one in (walked, walked.planned, walked.measured, walked.outcomes, found):
        assert len(repr(one)) < 200
        assert "\n" not in repr(one)


def bars(html: str) -> dict[int, list[tuple[float, float]]]:
    """Begin and end of each bar of a diagram, by legs, as parts of its width."""
    drawing = Xml.fromstring(html.partition("</p>")[2])
    found: dict[int, list[tuple[float, float]]] = {leg: [] for leg in range(6)}
    for bar in drawing.iter("rect"):
        x, y, width = (float(bar.attrib[name]) for name in ("x", "y", "width"))
        found[int(y // 14)].append(((x - 28) / 640, (x - 28 + width) / 640))
    return found


def test_a_notebook_shows_the_feet_that_are_off_the_ground(walked: hexmj.PhysicalWalk):
    time, off = walked.planned.time, ~walked.planned.stance[:, 0]
    drawn = bars(walked.planned._repr_html_() or "")
    for leg in range(len(LEGS)):
        expected = [(begin / 60, (begin + length) / 60) for begin, length in spans(time, off[:, leg])]
        np.testing.assert_allclose(drawn[leg], expected, atol=1e-3)
    html, fall = walked._repr_html_() or "", float(walked.outcomes.fall[0])
    assert f"which fell at {fall:.4g}" in html
    assert max(end for several in bars(html).values() for _, end in several) <= fall / 60 + 2e-3


def test_nothing_that_can_be_shown_is_no_error():
    tips = np.zeros((0, 0, 6))
    empty = hexmj.Walk(np.zeros(0), np.zeros((0, 0)), tips, tips, tips.astype(bool))
    assert repr(empty) == "Walk(0 steps, 0 starts, V = unknown)"
    assert empty._repr_html_() is None
