"""Pages: one file with all that it needs, which plays in a browser and shows the recording's own numbers."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from chromium import Tab, tab
from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import UNCOORDINATED
from hexmj.errors import InputError
from hexmj.measures.physical import PhysicalWalk, physical_walk
from hexmj.rendering.shapes import body_shape, geom_shape, ground_shape
from hexmj.replay.page import page, page_text
from hexmj.replay.recording import record, record_plan, save_recording
from hexmj.replay.take import Take
from hexmj.starts import draw_starts

WICKED = "</script><!--SCRIPT--><b>& \"quoted\" 'name' \N{GREEK SMALL LETTER ALPHA}"


@pytest.fixture(scope="module")
def walked() -> PhysicalWalk:
    return physical_walk(draw_starts(3, seed=1), UNCOORDINATED, 0.5, 24.0)


@pytest.fixture(scope="module")
def fallen(walked: PhysicalWalk) -> xr.Dataset:
    fell = np.flatnonzero(np.isfinite(walked.outcomes.fall))
    assert fell.size, "this test needs a start that falls"
    return record(walked, int(fell[0]), WICKED)


@pytest.fixture(scope="module")
def plan(walked: PhysicalWalk) -> xr.Dataset:
    return record_plan(walked.planned, walked.conditions, walked.stride, title="a plan")


def embedded(text: str) -> list[dict[str, Any]]:
    """What a page holds of its recordings."""
    (found,) = re.findall(r'<script type="application/json" id="recordings">(.*?)</script>', text, flags=re.DOTALL)
    return json.loads(found)


def array(packed: dict[str, Any]) -> np.ndarray:
    """An array as a browser reads it."""
    return np.frombuffer(base64.b64decode(packed["bytes"]), f"<{packed['type']}").reshape(packed["shape"])


def test_margins_times_and_stance_are_the_recording_s_to_the_last_bit(fallen, plan):
    for recording, told in zip((fallen, plan), embedded(page_text([fallen, plan])), strict=True):
        names = ["planned_margin", "planned_stance", "seconds"]
        names += ["measured_margin", "measured_stance"] if told["physical"] else []
        for name in names:
            shown = array(told[name])
            assert shown.dtype in (np.float64, np.uint8)
            np.testing.assert_array_equal(shown, recording[name].values)


def test_poses_are_those_of_the_recording(fallen):
    (told,) = embedded(page_text([fallen]))
    take, rows, poses = Take.of(fallen), array(told["rows"]), array(told["poses"])
    assert rows[0] == 0
    assert rows[-1] == len(take.qpos) - 1
    model = compile_body(take.conditions).model
    data, root = mujoco.MjData(model), model.body(STICK_INSECT.root).id
    for row, pose, tips in zip(rows, poses, array(told["tips"]), strict=True):
        data.qpos[:] = take.qpos[row]
        mujoco.mj_kinematics(model, data)
        assert_allclose(pose, np.concatenate([data.xpos, data.xquat], axis=1), atol=1e-5)
        assert_allclose(pose[root], take.qpos[row, :7], atol=1e-5)
        assert_allclose(tips[:, :2], take.feet[row], atol=1e-5)
    assert_allclose(array(told["planned_tips"]), take.planned_tip[rows], atol=1e-5)


def test_what_has_happened_is_told_as_far_as_it_is_shown(fallen, plan):
    take = Take.of(fallen)
    lost, fell = (f"{1000 * seconds:.0f} ms" for seconds in (take.lost, take.fell))
    before = int(take.lost / take.step) - 1
    for recording, told in (
        (fallen, f"stability first lost at {lost}, fell on {take.part} at {fell}"),
        (fallen.isel(step=slice(before)), "stability not lost in this part"),
        (fallen.isel(step=slice(before + 5, before + 9)), f"stability first lost at {lost}"),
        (plan.assign(planned_loss_time=np.inf), "stability never lost"),
    ):
        assert embedded(page_text([recording]))[0]["happened"] == told


def test_a_polygon_has_standing_feet_as_corners(fallen):
    (told,) = embedded(page_text([fallen]))
    take = Take.of(fallen)
    for row, corners in zip(array(told["rows"]), array(told["polygon"]), strict=True):
        known = corners[np.isfinite(corners[:, 0])]
        feet = take.feet[row][take.stance[row]].astype(np.float32)
        assert len(known) >= min(3, len(feet))
        assert {tuple(one) for one in known} <= {tuple(one) for one in feet}


def test_shapes_are_closed_and_look_outwards():
    """Every edge of a closed surface is walked once in each direction; its volume is above 0, and as MuJoCo has it."""
    kinds = mujoco.mjtGeom
    spec = mujoco.MjSpec()
    sizes = {kinds.mjGEOM_SPHERE: (2, 0, 0), kinds.mjGEOM_CAPSULE: (1, 3, 0), kinds.mjGEOM_CYLINDER: (1, 2, 0)}
    sizes |= {kinds.mjGEOM_ELLIPSOID: (1, 2, 3), kinds.mjGEOM_BOX: (1, 2, 3)}
    for kind, size in sizes.items():
        body = spec.worldbody.add_body(name=kind.name)
        body.add_geom(name=kind.name, type=kind, size=size, density=1.0)
    model = spec.compile()
    for kind in sizes:
        shape = geom_shape(model, model.geom(kind.name).id)
        a, b, c = np.moveaxis(shape.corners[shape.faces], 1, 0)
        volume = (a * np.cross(b, c)).sum() / 6
        assert volume == pytest.approx(model.body(kind.name).mass[0], rel=0.15), kind
        outwards = (np.cross(b - a, c - a) * shape.normals[shape.faces].mean(axis=1)).sum(axis=1)
        assert (outwards >= -1e-9).all(), kind
        assert_allclose(np.linalg.norm(shape.normals, axis=1), 1.0)


@pytest.mark.parametrize("ground", ["flat", "step", "gap", "hurdle", "rough"])
def test_the_ground_is_as_high_as_it_is(ground):
    shape = ground_shape(compile_body(Conditions(ground=ground, ground_height=2.0) if ground != "gap" else
                                      Conditions(ground="gap")))  # fmt: skip
    assert (len(shape.faces) > 0) == (ground != "flat")
    if ground in ("step", "hurdle", "rough"):
        assert 0 < shape.corners[:, 2].max() <= 2.0 + 1e-9
    assert (shape.faces < max(1, len(shape.corners))).all()


def test_a_geom_has_its_own_colour_before_that_of_its_material():
    model = compile_body(Conditions()).model
    colours = body_shape(model).colour
    model.geom_rgba[model.geom_matid >= 0] = 1.0, 0.0, 1.0, 1.0
    assert not np.array_equal(body_shape(model).colour, colours)
    model.geom_rgba[:] = 0.0
    assert len(body_shape(model).faces) == 0


def test_whatever_is_hidden_is_not_drawn():
    model = compile_body(Conditions()).model
    whole = len(body_shape(model).faces)
    model.geom_group[:] = 3
    assert whole > 1000
    assert len(body_shape(model).faces) == 0


def test_a_page_refers_to_nothing_outside_and_no_title_ends_its_script(fallen, plan):
    text = page_text([fallen, plan])
    shell = re.sub(r'"bytes": "[^"]*"', "", text)
    assert not re.findall(r"https?:|//[a-z]|@import|url\(|\bsrc=|fetch\(|XMLHttp|WebSocket", shell)
    assert "default-src 'none'" in text
    assert text.count("</script>") == 2
    assert [one["title"] for one in embedded(text)] == [WICKED, "a plan"]


def test_wrong_input_is_one_sentence(run, fallen, plan, tmp_path):
    for recordings in ([], [plan] * 3):
        with pytest.raises(InputError, match="recordings were given; expected 1 or 2"):
            page(recordings, tmp_path / "page.html")
    with pytest.raises(InputError, match=r"expected a name with \.html"):
        page([plan], tmp_path / "page.htm")
    with pytest.raises(InputError, match="of the body 'stick_insect', not of 'beetle'"):
        page([plan], tmp_path / "page.html", body=replace(STICK_INSECT, name="beetle"))
    assert list(tmp_path.iterdir()) == []
    code, _, error = run("page", "--out", tmp_path)
    assert (code, error.count("\n")) == (2, 1)


def test_the_command_writes_the_page_of_the_function(run, fallen, plan, tmp_path):
    paths = [save_recording(one, tmp_path / f"{name}.nc") for name, one in {"a": fallen, "b": plan}.items()]
    code, answer, error = run("page", *paths, "--out", tmp_path / "out", "--json")
    assert code == 0, error
    assert [Path(name).name for name in json.loads(answer)["files"]] == ["walk.html", "walk.html-manifest.json"]
    assert (tmp_path / "out" / "walk.html").read_text(encoding="utf-8") == page_text([fallen, plan])


def go_to(opened: Tab, step: int) -> None:
    """Move the slider to the end of a step, and wait until that is drawn."""
    opened.value(f"(() => {{ const s = document.querySelector('#time'); s.value = {step}; s.oninput(); }})()")
    opened.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


CUT = """[...document.querySelectorAll('#speed, .state')].filter((one) => {
    const wide = one.getBoundingClientRect().width;
    Object.assign(one.style, { flex: 'none', width: 'max-content', whiteSpace: 'nowrap' });
    const whole = one.getBoundingClientRect().width;
    one.removeAttribute('style');
    return wide < whole - 1 || one.offsetParent.clientWidth < whole;
}).length"""
"""How many of the speed menu and what is said of the state have not the room that one line of them takes."""


@pytest.mark.slow
def test_a_browser_without_a_network_plays_it(fallen, plan, tmp_path):
    path = page([fallen, plan], tmp_path / "page.html")
    fell = int(np.isfinite(fallen.measured_margin.values).sum())
    with tab() as opened:
        opened.resize(360, 740, phone=True)
        opened.open(path.as_uri())
        assert opened.value(CUT) == 0
        assert opened.value("[...document.querySelectorAll('h1')].map((one) => one.textContent)") == [WICKED, "a plan"]
        for step in (1, fell // 2, fell, fell + 2):
            go_to(opened, step)
            shown = opened.value("[...document.querySelectorAll('.margin')].map((one) => one.value)")
            expected = fallen.measured_margin.values[step - 1], plan.planned_margin.values[step - 1]
            np.testing.assert_array_equal([float(one) for one in shown], expected)
        words = opened.value("[...document.querySelectorAll('.word')].map((one) => one.textContent)")
        assert "fell on" in words[0]
        go_to(opened, 0)
        opened.press(" ")
        opened.wait("Number(document.querySelector('#time').value) > 20")
        opened.press(" ")
        assert opened.value("document.querySelector('#play').getAttribute('aria-label')") == "Play"
        before = opened.value("document.querySelector('#time').valueAsNumber")
        opened.press("ArrowRight")
        opened.wait(f"document.querySelector('#time').valueAsNumber === {before + 1}")
        assert opened.value("document.querySelector('.complaint').hidden")
        assert opened.value("document.documentElement.scrollWidth") <= 390
        assert [one for one in opened.requests if not one.startswith("data:")] == [path.as_uri()]
        assert opened.complaints == []
