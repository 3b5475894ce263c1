"""Films: what is in the MP4 files, and how rendering is found to be possible."""

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
import xarray as xr
from PIL import Image, ImageSequence

from compiled_bodies import changed_body
from drawing import drawing
from film_reader import read_film
from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT
from hexmj.controllers.cruse1998 import UNCOORDINATED
from hexmj.errors import InputError, RenderingError
from hexmj.measures.physical import PhysicalWalk, physical_walk
from hexmj.rendering import gl
from hexmj.replay.film.film import Film
from hexmj.replay.film.overlay import Overlay, _ticks
from hexmj.replay.film.video import _view, render
from hexmj.replay.footfall import walk_figure
from hexmj.replay.recording import load_recording, record, record_plan, save_recording
from hexmj.replay.schema import MEASURED, PLANNED
from hexmj.replay.take import Take, margin_in_words
from hexmj.starts import draw_starts

DURATION = 24.0  # time units, 0.3 s


def scene(frames: np.ndarray) -> np.ndarray:
    """Frames without caption and diagram."""
    height = frames.shape[-3]
    return frames[..., round(0.11 * height) : round(0.82 * height), :, :].astype(int)


def green(pixels: np.ndarray) -> int:
    red, middle, blue = np.moveaxis(pixels, -1, 0)
    return int(((middle - red > 60) & (middle - blue > 30)).sum())


def red(pixels: np.ndarray) -> int:
    first, middle, blue = np.moveaxis(pixels, -1, 0)
    return int(((first - middle > 80) & (first - blue > 80)).sum())


@pytest.fixture(scope="module")
def walked() -> PhysicalWalk:
    return physical_walk(draw_starts(3, seed=1), UNCOORDINATED, 0.5, DURATION)


@pytest.fixture(scope="module")
def start(walked: PhysicalWalk) -> int:
    """One that is stable at first and falls in the end."""
    late = np.isfinite(walked.outcomes.fall) & (walked.outcomes.measured_loss > 5)
    assert late.any(), "this test needs a start that falls, but not at once"
    return int(np.argmax(late))


@pytest.fixture(scope="module")
def fallen(walked: PhysicalWalk, start: int) -> xr.Dataset:
    return record(walked, start, "a fall")


@pytest.fixture(scope="module")
def plan(walked: PhysicalWalk, start: int) -> xr.Dataset:
    return record_plan(walked.planned, walked.conditions, walked.stride, start, "its plan")


@drawing
def test_a_film_has_the_frames_of_its_walk_in_its_colours(fallen, tmp_path):
    """Each frame shows the walk's time; the polygon is green while the margin is positive, then red."""
    path = save_recording(fallen, tmp_path / "recording.nc")
    film = Film(slow_motion=4.0, camera="top")
    told: list[float] = []
    with load_recording(path) as recording:
        frames = render([recording], tmp_path / "film.mp4", film, told.append)
    assert frames == 36  # 0.3 s * 4 * 30
    assert sum(told) == pytest.approx(1.0)
    played, fps = read_film(tmp_path / "film.mp4")
    assert played.shape == (frames, 480, 640, 3)
    assert fps == 30
    assert frames / fps == pytest.approx(4.0 * float(fallen.seconds[-1]), abs=1 / fps)
    shots = scene(played)
    assert np.abs(np.diff(shots[:10], axis=0)).max(axis=(1, 2, 3)).min() > 20
    vp, dt = fallen.attrs["vp"], fallen.attrs["dt"]
    shown = np.isfinite(fallen.measured_margin.values).sum()
    for frame in range(frames):
        row = int(np.clip(round(frame / 120 * vp / dt) - 1, 0, shown - 1))
        stable = bool(fallen.measured_margin[row] > 0)
        assert (green(shots[frame]) > 1000) == stable, frame
        assert (red(shots[frame]) > 300) == (not stable), frame
    after = round(float(fallen.fall_time) / vp * 120) + 2
    assert np.abs(shots[after] - shots[-1]).mean() < 1.0, "it freezes after the fall"


@drawing
def test_slow_motion_multiplies_the_frames(fallen, tmp_path):
    films = [Film(slow_motion=slow, width=320, height=240) for slow in (1.0, 2.0, 3.5)]
    counts = [render([fallen], tmp_path / "film.mp4", film) for film in films]
    assert counts == [9, 18, round(0.3 * 3.5 * 30)]
    assert len(read_film(tmp_path / "film.mp4")[0]) == counts[-1]


@pytest.mark.slow
@drawing
def test_a_film_of_two_has_them_side_by_side_with_one_clock(walked, plan, fallen, tmp_path):
    film = Film(slow_motion=2.0, width=320, height=240)
    shorter = plan.isel(step=slice(None, 160))
    assert render([shorter, fallen], tmp_path / "two.mp4", film) == 18
    render([fallen], tmp_path / "one.mp4", film)
    two, one = read_film(tmp_path / "two.mp4")[0], read_film(tmp_path / "one.mp4")[0]
    assert two.shape == (18, 240, 640, 3)
    assert np.abs(two[:, :, 320:].astype(int) - one).mean() < 2.0
    left = scene(two)[:, :, :320]
    assert np.abs(left[5] - left[2]).mean() > 2 * np.abs(left[17] - left[14]).mean(), "the shorter one freezes"


@drawing
def test_a_title_that_the_font_has_not_is_told(fallen, tmp_path):
    boxes, plain = (fallen.assign_attrs(title=title) for title in ("三角 A 三", "Schräg, Ωmega"))
    told = "^the film shows a box for each of 三角 in the title '三角 A 三'; its font has"
    with pytest.warns(UserWarning, match=told) as warned:
        render([boxes, plain, boxes], tmp_path / "film.mp4", Film(fps=5, width=320, height=240))
    assert len(warned) == 1


@drawing
def test_a_film_of_a_part_shows_the_moments_that_it_tells(fallen, tmp_path):
    """Its frames are those of the whole film at these times."""
    film, part = Film(slow_motion=5.0, width=320, height=240), fallen.isel(step=slice(80, 160))  # from 0.1 to 0.2 s
    frames = 15  # 0.1 s * 5 * 30
    assert render([part], tmp_path / "part.mp4", film) == frames
    render([fallen], tmp_path / "whole.mp4", film)
    shown, whole = (read_film(tmp_path / f"{name}.mp4")[0] for name in ("part", "whole"))
    same = np.abs(scene(shown) - scene(whole)[frames : 2 * frames]).mean(axis=(1, 2, 3))
    other = np.abs(scene(shown) - scene(whole)[:frames]).mean(axis=(1, 2, 3))
    assert (same[1:] < 0.3 * other[1:]).all()  # at its beginning a part shows its first step, not the one before
    take, row = Take.of(part), int(np.argmin(np.abs(fallen.seconds.values - 0.15)))
    np.testing.assert_array_equal(take.qpos[take.row(0.15)], fallen.qpos[row])
    assert _ticks(1000 * take.begin, 1000 * take.end).tolist() == list(range(100, 201, 10))
    assert [f"{one:g}" for one in _ticks(0.0, 10.0)] == [str(one) for one in range(11)]


@drawing
def test_a_gif_plays_the_same_walk(fallen, tmp_path):
    frames = render([fallen], tmp_path / "film.gif", Film(width=320, height=240, fps=10, slow_motion=4.0))
    with Image.open(tmp_path / "film.gif") as film:
        assert (getattr(film, "n_frames", 1), film.size) == (frames, (320, 240))
        assert sum(film.info["duration"] for film in ImageSequence.Iterator(film)) == pytest.approx(1200, abs=100)


@pytest.mark.parametrize("kind", ["fallen", "plan"])
def test_a_film_and_the_figure_of_its_walk_have_the_same_bars(kind: str, request):
    """Which are black in both: a foot off the ground, or a protraction of a puppet."""
    recording = request.getfixturevalue(kind)
    take = Take.of(recording)
    footfall = walk_figure(recording).axes[0]
    time, step = recording.time.values, recording.attrs["dt"]
    bars = [one for one in footfall.collections if np.ptp(np.asarray(one.get_facecolor())[0, :3]) == 0]
    assert len(bars) == 6
    for leg, one in enumerate(bars):
        corners = [np.asarray(path.vertices) for path in one.get_paths()]
        spans = [(np.min(corner[:, 0]), np.max(corner[:, 0])) for corner in corners]
        drawn = [any(low < end - step / 2 < high for low, high in spans) for end in time[: len(take.stance)]]
        assert np.array_equal(drawn, ~take.stance[:, leg])
        assert all(high <= time[len(take.stance) - 1] + 1e-9 for _, high in spans), "none after a fall"
        assert all(np.min(corner[:, 1]) < leg < np.max(corner[:, 1]) for corner in corners)


def test_what_was_not_recorded_is_not_told(plan):
    """Beside a longer recording, or one that begins before."""
    take = Take.of(plan.isel(step=slice(10, 40)))
    overlay = Overlay(take, Film(), 0.0, 1.0)
    early, late = overlay._state(0, 0.0)[0], overlay._state(29, 1.0)[0]
    assert (early, late) == (f"recorded from {1e3 * take.begin:.0f} ms", f"recorded until {1e3 * take.end:.0f} ms")
    for row, seconds in ((0, take.begin), (29, take.end)):
        assert "stable" in overlay._state(row, seconds)[0]


def test_what_is_stable_is_told_without_colours(fallen):
    """By a sign and by words, of now and of what was before; the bar of the scale is as long as it says."""
    take = Take.of(fallen)
    overlay = Overlay(take, Film(slow_motion=4.0), take.begin, take.end)
    unstable = int(np.argmax(take.margin <= 0))
    again = replace(take, margin=np.abs(take.margin))
    states = [overlay._state(row, seconds)[0] for row, seconds in ((0, 0.0), (unstable, take.lost), (0, take.fell))]
    assert [state[0] for state in states] == ["●", "▲", "■"]
    assert "stable, but lost at" in Overlay(again, Film(), 0.0, 1.0)._state(unstable, take.lost)[0]
    assert [margin_in_words(margin) for margin in (-1.25, -np.inf)] == ["margin -1.2 mm", "no foot stands"]
    frame = np.full((480, 640, 3), 200, dtype=np.uint8)
    overlay.draw(frame, 0, 0.0, 5.0)
    strip = frame[400 - 9]
    assert (strip[10:300, 0] < 60).argmin() == 101, "20 mm at 5 pixels/mm, from end to end"


@drawing
def test_the_scale_is_that_of_the_camera(plan):
    """From above, a mm near the ground is as many pixels as the MJCF's camera says."""
    take = Take.of(plan)
    film, model = Film(camera="top"), compile_body(take.conditions).model
    model.vis.global_.offwidth, model.vis.global_.offheight = film.width, film.height
    with gl.renderer(model, film.height, film.width) as renderer:
        _, scale = _view(renderer, mujoco.MjData(model), "top", take, 0)
    height = model.cam("top").pos[2]  # above the centre of mass of what it tracks
    assert scale == pytest.approx(480 / (2 * height * np.tan(np.radians(model.cam("top").fovy[0] / 2))), rel=0.05)


@drawing
def test_the_scale_of_an_orthographic_camera_is_the_same_everywhere(plan, tmp_path):
    camera = '<worldbody><camera name="plan" projection="orthographic" fovy="80" pos="0 0 200"/>'
    body = changed_body(tmp_path, {"<worldbody>": camera})
    body = replace(body, name=STICK_INSECT.name, cameras=(*STICK_INSECT.cameras, "plan"))
    take, film = Take.of(plan, body), Film(camera="plan")
    model = compile_body(take.conditions).model
    model.vis.global_.offwidth, model.vis.global_.offheight = film.width, film.height
    with gl.renderer(model, film.height, film.width) as renderer:
        _, scale = _view(renderer, mujoco.MjData(model), "plan", take, 0)
    assert scale == pytest.approx(480 / 80.0), "fovy is the height of what is seen [mm]"


@drawing
def test_a_camera_that_the_insect_has_passed_has_no_scale(plan, tmp_path):
    """It stands in the world, 10 mm ahead; the film goes on."""
    camera = '<worldbody><camera name="ahead" pos="10 0 12" xyaxes="0 1 0 0 0 1"/>'
    body = changed_body(tmp_path, {"<worldbody>": camera})
    body = replace(body, name=STICK_INSECT.name, cameras=(*STICK_INSECT.cameras, "ahead"))
    frames = render([plan], tmp_path / "film.mp4", Film(camera="ahead"), body=body)
    assert len(read_film(tmp_path / "film.mp4")[0]) == frames
    blank = np.full((18, 640, 3), 200, dtype=np.uint8)
    assert (Overlay(Take.of(plan), Film(), 0.0, 1.0)._strip(blank, 0.0)[:, :300] == 200).all()


@drawing
def test_high_quality_has_shadows(fallen, tmp_path):
    dark = {}
    for film in (Film(quality="fast", slow_motion=0.2), Film(quality="high", slow_motion=0.2)):
        render([fallen], tmp_path / "film.mp4", film)
        shot = scene(read_film(tmp_path / "film.mp4")[0][0])[:-18]  # without the words at the scale
        dark[film.quality] = ((shot < 150).all(axis=-1) & (np.ptp(shot, axis=-1) < 25)).mean()
    assert dark["high"] > 2 * dark["fast"]


@pytest.mark.parametrize("camera", STICK_INSECT.cameras)
@drawing
def test_the_insect_keeps_clear_of_the_diagram(camera, plan, tmp_path):
    """Around the scene, above the diagram and below the caption, there are neither legs nor polygon."""
    render([plan], tmp_path / "film.mp4", Film(camera=camera, slow_motion=0.5))
    for shot in scene(read_film(tmp_path / "film.mp4")[0]):
        for strip in (shot[:8], shot[-8:]):
            assert np.ptp(strip, axis=-1).max() < 30


@drawing
def test_films_that_make_no_sense(fallen, tmp_path):
    changes: dict[str, Any] = {"width": 641, "height": 0, "quality": "best", "fps": 0.0}
    for name, value in changes.items():
        with pytest.raises(InputError, match=f"{name} = {value!r}; "):
            Film(**{name: value})
    with pytest.raises(InputError, match="camera = 'behind'; valid names of stick_insect: following, side, top, front"):
        render([fallen], tmp_path / "film.mp4", Film(camera="behind"))
    with pytest.raises(InputError, match="fps = 60 of a GIF; expected at most 50"):
        render([fallen], tmp_path / "film.gif", Film(fps=60.0))
    with pytest.raises(InputError, match="7 recordings were given; expected 1 to 6"):
        render([fallen] * 7, tmp_path / "film.mp4")
    for path in (tmp_path / "film.avi", tmp_path / "nowhere" / "film.mp4"):
        with pytest.raises(InputError, match=r"expected a name with \.mp4 or \.gif in a folder that exists"):
            render([fallen], path)
    with pytest.raises(InputError, match="'a fall' holds no pose"):
        poses = [name for name, one in (PLANNED | MEASURED).items() if one.gaps == "after a fall"]
        unseen = fallen.assign({name: fallen[name] * np.nan for name in poses} | {"fall_time": fallen.fall_time * 0.0})
        render([unseen], tmp_path / "film.mp4")


@drawing
def test_a_film_that_fails_leaves_the_old_one(fallen, tmp_path):
    path = tmp_path / "film.mp4"
    path.write_text("old")

    def fail(done: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render([fallen], path, Film(width=320, height=240), fail)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@drawing
def test_without_what_encodes_films_it_is_said_what_brings_it(fallen, tmp_path, monkeypatch, run):
    monkeypatch.setitem(sys.modules, "mediapy", None)
    with pytest.raises(RenderingError, match=r'pip install "\.\[film\]"'):
        render([fallen], tmp_path / "film.mp4")
    code, _, error = run("render", "--observation time", "5", "--out", tmp_path / "out")
    assert code == 1 and 'pip install ".[film]"' in error
    assert not list(tmp_path.iterdir())


@drawing
def test_whether_anything_can_be_rendered_is_known():
    assert gl.missing() is None
    kept = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
    program = "from hexmj.rendering import gl; gl.missing(); print(gl.missing())"
    for backend in ("glfw", "disable"):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", program],
            env=kept | {"MUJOCO_GL": backend, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        assert "libegl1 libgl1-mesa-dri libopengl0" in done.stdout
        assert done.stderr == ""


@drawing
def test_nothing_is_left_in_memory_of_the_graphics(fallen, tmp_path):
    """Films one after the other: every renderer is closed, and a new context still works."""
    for _ in range(3):
        render([fallen], tmp_path / "film.mp4", Film(width=64, height=64, slow_motion=0.2))
    gl.context_type()(16, 16).free()
