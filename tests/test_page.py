"""Pages: the numbers of a recording, its shapes, and a browser that plays them."""

import base64
import json
import re
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from chromium import tab
from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT
from hexmj.conditions import Conditions, GroundKind
from hexmj.controllers.cruse1998 import UNCOORDINATED
from hexmj.errors import InputError
from hexmj.measures.physical import PhysicalWalk, physical_walk
from hexmj.rendering.shapes import body_shapes, geom_shape, ground_shape, joined
from hexmj.replay.page import page, page_text
from hexmj.replay.recording import record, record_plan
from hexmj.replay.take import Take
from hexmj.starts import draw_starts

TITLE = "</script><!--SCRIPT--><b>& \"quoted\" 'name' \N{GREEK SMALL LETTER ALPHA}"


@pytest.fixture(scope="module")
def walked() -> PhysicalWalk:
    return physical_walk(draw_starts(3, seed=1), UNCOORDINATED, 0.5, 24.0)


@pytest.fixture(scope="module")
def fallen(walked: PhysicalWalk) -> xr.Dataset:
    fell = np.flatnonzero(np.isfinite(walked.outcomes.fall))
    assert fell.size, "this test needs a start that falls"
    return record(walked, int(fell[0]), TITLE)


@pytest.fixture(scope="module")
def plan(walked: PhysicalWalk) -> xr.Dataset:
    return record_plan(walked.planned, walked.conditions, walked.stride, title="a plan")


def embedded(text: str) -> list[dict[str, Any]]:
    """The recordings of a page."""
    (found,) = re.findall(r'<script type="application/json" id="recordings">(.*?)</script>', text, flags=re.DOTALL)
    return json.loads(found)


def array(packed: dict[str, Any]) -> np.ndarray:
    """An array as a browser reads it."""
    return np.frombuffer(base64.b64decode(packed["bytes"]), f"<{packed['type']}").reshape(packed["shape"])


def test_margins_times_and_stance_are_the_recording_s_to_the_last_bit(fallen, plan):
    for recording, data in zip((fallen, plan), embedded(page_text([fallen, plan])), strict=True):
        names = ["planned_margin", "planned_stance", "seconds"]
        names += ["grounded_margin", "grounded_stance"] if data["physical"] else []
        for name in names:
            shown = array(data[name])
            assert shown.dtype in (np.float64, np.uint8)
            np.testing.assert_array_equal(shown, recording[name].values)


def test_poses_and_polygons_are_those_of_the_recording(fallen):
    (data,) = embedded(page_text([fallen]))
    take, rows = Take.of(fallen), array(data["rows"])
    assert (rows[0], rows[-1]) == (0, len(take.qpos) - 1)
    model = compile_body(take.conditions).model
    bodies, root = mujoco.MjData(model), model.body(STICK_INSECT.root).id
    shown = zip(rows, array(data["poses"]), array(data["tips"]), array(data["polygon"]), strict=True)
    for row, pose, tips, corners in shown:
        bodies.qpos[:] = take.qpos[row]
        mujoco.mj_kinematics(model, bodies)
        assert_allclose(pose, np.concatenate([bodies.xpos, bodies.xquat], axis=1), atol=1e-5)
        assert_allclose(pose[root], take.qpos[row, :7], atol=1e-5)
        assert_allclose(tips[:, :2], take.feet[row], atol=1e-5)
        known = corners[np.isfinite(corners[:, 0])]
        feet = take.feet[row][take.stance[row]].astype(np.float32)
        assert len(known) >= min(3, len(feet))
        assert {tuple(corner) for corner in known} <= {tuple(foot) for foot in feet}
    assert_allclose(array(data["planned_tips"]), take.planned_tip[rows], atol=1e-5)


def test_events_are_told_as_far_as_they_are_shown(fallen, plan):
    take = Take.of(fallen)
    lost, fell = (f"{1000 * seconds:.0f} ms" for seconds in (take.lost, take.fell))
    before = int(take.lost / take.step) - 1
    for recording, shown, absent in (
        (fallen, (lost, take.part, fell), "never"),
        (fallen.isel(step=slice(before)), ("not lost",), lost),
        (fallen.isel(step=slice(before + 5, before + 9)), (lost,), fell),
        (plan.assign(planned_loss_time=np.inf), ("never lost",), "ms"),
    ):
        happened = embedded(page_text([recording]))[0]["happened"]
        assert all(text in happened for text in shown)
        assert absent not in happened


def test_shapes_are_closed_and_look_outwards():
    """The volume is above 0 and MuJoCo's; normals point away from the inside."""
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
def test_the_ground_has_its_height(ground: GroundKind):
    height: dict[str, Any] = {} if ground in ("flat", "gap") else {"ground_height": 2.0}
    shape = ground_shape(compile_body(Conditions(ground=ground, **height)))
    assert (len(shape.faces) > 0) == (ground != "flat")
    if height:
        assert 0 < shape.corners[:, 2].max() <= 2.0 + 1e-9
    assert (shape.faces < max(1, len(shape.corners))).all()


def test_colours_are_mujoco_s_and_hidden_geoms_have_no_faces():
    model = compile_body(Conditions()).model
    seen = joined(body_shapes(model))
    model.geom_rgba[model.geom_matid >= 0] = 1.0, 0.0, 1.0, 1.0
    assert not np.array_equal(joined(body_shapes(model)).colour, seen.colour)
    group = model.geom_group.copy()
    model.geom_group[:] = 3
    assert len(seen.faces) > 1000
    assert len(joined(body_shapes(model)).faces) == 0
    model.geom_group[:], model.geom_rgba[:] = group, 0.0
    assert len(joined(body_shapes(model)).faces) == 0


def test_a_page_loads_nothing_and_no_title_ends_its_script(fallen, plan, tmp_path):
    text = page_text([fallen, plan])
    shell = re.sub(r'"bytes": "[^"]*"', "", text)
    assert not re.findall(r"https?:|//[a-z]|@import|url\(|\bsrc=|fetch\(|XMLHttp|WebSocket", shell)
    assert "default-src 'none'" in text
    assert text.count("</script>") == 2
    assert [data["title"] for data in embedded(text)] == [TITLE, "a plan"]
    assert page([fallen, plan], tmp_path / "page.html").read_text(encoding="utf-8") == text


def test_bad_arguments_are_refused(plan, tmp_path):
    for recordings, name, body, argument in (
        ([], "page.html", STICK_INSECT, "recordings"),
        ([plan], "page.html", replace(STICK_INSECT, name="beetle"), "body"),
    ):
        with pytest.raises(InputError, match=argument):
            page(recordings, tmp_path / name, body=body)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_browser_without_a_network_plays_it(fallen, plan, tmp_path):
    path = page([fallen, plan], tmp_path / "page.html")
    fell = int(np.isfinite(fallen.grounded_margin.values).sum())
    drawn = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    with tab() as opened:
        opened.resize(390, 740)
        opened.open(path.as_uri())
        assert opened.value("[...document.querySelectorAll('h1')].map((head) => head.textContent)") == [TITLE, "a plan"]
        for step in (1, fell // 2, fell, fell + 2):
            opened.value(f"(() => {{ const s = document.querySelector('#time'); s.value = {step}; s.oninput(); }})()")
            opened.value(drawn)
            shown = opened.value("[...document.querySelectorAll('.margin')].map((margin) => margin.value)")
            expected = fallen.grounded_margin.values[step - 1], plan.planned_margin.values[step - 1]
            np.testing.assert_array_equal([float(margin) for margin in shown], expected)
        assert "fell on" in opened.value("document.querySelector('.word').textContent")
        opened.value("(() => { const s = document.querySelector('#time'); s.value = 0; s.oninput(); })()")
        opened.press(" ")
        opened.wait("Number(document.querySelector('#time').value) > 20")
        opened.press(" ")
        assert opened.value("document.querySelector('#play').getAttribute('aria-label')") == "Play"
        before = opened.value("document.querySelector('#time').valueAsNumber")
        opened.press("ArrowRight")
        opened.wait(f"document.querySelector('#time').valueAsNumber === {before + 1}")
        assert opened.value("document.querySelector('.complaint').hidden")
        assert opened.value("document.documentElement.scrollWidth") <= 390
        assert [request for request in opened.requests if not request.startswith("data:")] == [path.as_uri()]
        assert opened.complaints == []
