"""Films: frames, colours, clock, overlay and encoder."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
import xarray as xr
from PIL import Image, ImageSequence

from drawing import drawing
from film_reader import read_film
from hexmj.bodies.mjcf import compile_body
from hexmj.body import STICK_INSECT
from hexmj.controllers.cruse1998 import UNCOORDINATED
from hexmj.errors import InputError, RenderingError
from hexmj.measures.physical import PhysicalWalk, physical_walk
from hexmj.rendering import gl
from hexmj.replay.recording import record, record_plan
from hexmj.replay.take import Take, margin_in_words, walk_figure
from hexmj.replay.video import Film, Overlay, _view, render
from hexmj.starts import draw_starts

DURATION = 24.0  # time units, 0.3 s
SMALL = Film(slow_motion=2.0, width=320, height=240)


def scene(frames: np.ndarray) -> np.ndarray:
    """Frames without caption, legend and diagram."""
    height = frames.shape[-3]
    return frames[..., round(0.11 * height) : round(0.79 * height), :, :].astype(int)


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
    """A start that is stable at first and falls in the end."""
    late = np.isfinite(walked.outcomes.fall) & (walked.outcomes.grounded_loss > 5)
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
    film, done = Film(slow_motion=4.0, camera="top"), list[float]()
    frames = render([fallen], tmp_path / "film.mp4", film, done.append)
    assert frames == 36  # 0.3 s * 4 * 30
    assert sum(done) == pytest.approx(1.0)
    played, fps = read_film(tmp_path / "film.mp4")
    assert played.shape == (frames, 480, 640, 3)
    assert fps == 30
    assert frames / fps == pytest.approx(4.0 * float(fallen.seconds[-1]), abs=1 / fps)
    shots = scene(played)
    assert np.abs(np.diff(shots[:10], axis=0)).max(axis=(1, 2, 3)).min() > 20
    vp, dt = fallen.attrs["vp"], fallen.attrs["dt"]
    shown = np.isfinite(fallen.grounded_margin.values).sum()
    for frame in range(frames):
        row = int(np.clip(round(frame / 120 * vp / dt) - 1, 0, shown - 1))
        stable = bool(fallen.grounded_margin[row] > 0)
        assert (green(shots[frame]) > 1000) == stable, frame
        assert (red(shots[frame]) > 300) == (not stable), frame
    after = round(float(fallen.fall_time) / vp * 120) + 2
    assert np.abs(shots[after] - shots[-1]).mean() < 1.0, "it freezes after the fall"


@drawing
def test_a_film_of_two_has_them_side_by_side_with_one_clock(plan, fallen, tmp_path):
    shorter = plan.isel(step=slice(None, 160))
    assert render([shorter, fallen], tmp_path / "two.mp4", SMALL) == 18
    assert render([fallen], tmp_path / "one.mp4", SMALL) == 18
    two, one = read_film(tmp_path / "two.mp4")[0], read_film(tmp_path / "one.mp4")[0]
    assert two.shape == (18, 240, 640, 3)
    assert np.abs(two[:, :, 320:].astype(int) - one).mean() < 2.0
    left = scene(two)[:, :, :320]
    assert np.abs(left[5] - left[2]).mean() > 2 * np.abs(left[17] - left[14]).mean(), "the shorter one freezes"


@drawing
def test_a_film_of_a_part_shows_the_frames_of_the_whole_film(fallen, tmp_path):
    film, part = replace(SMALL, slow_motion=5.0), fallen.isel(step=slice(80, 160))  # from 0.1 to 0.2 s
    frames = 15  # 0.1 s * 5 * 30
    assert render([part], tmp_path / "part.mp4", film) == frames
    render([fallen], tmp_path / "whole.mp4", film)
    shown, whole = (read_film(tmp_path / f"{name}.mp4")[0] for name in ("part", "whole"))
    same = np.abs(scene(shown) - scene(whole)[frames : 2 * frames]).mean(axis=(1, 2, 3))
    other = np.abs(scene(shown) - scene(whole)[:frames]).mean(axis=(1, 2, 3))
    assert (same[1:] < 0.3 * other[1:]).all()  # a part begins with its first step, not with the one before
    take, row = Take.of(part), int(np.argmin(np.abs(fallen.seconds.values - 0.15)))
    np.testing.assert_array_equal(take.qpos[take.row(0.15)], fallen.qpos[row])


@drawing
def test_a_gif_lasts_as_long_as_the_walk(fallen, tmp_path):
    frames = render([fallen], tmp_path / "film.gif", replace(SMALL, fps=10.0, slow_motion=4.0))
    with Image.open(tmp_path / "film.gif") as film:
        assert (getattr(film, "n_frames", 1), film.size) == (frames, (320, 240))
        assert sum(film.info["duration"] for film in ImageSequence.Iterator(film)) == pytest.approx(1200, abs=100)


@pytest.mark.parametrize("kind", ["fallen", "plan"])
def test_a_film_and_the_figure_of_its_walk_have_the_same_bars(kind: str, request):
    recording = request.getfixturevalue(kind)
    take = Take.of(recording)
    footfall = walk_figure(recording).axes[0]
    time, step = recording.time.values, recording.attrs["dt"]
    bars = footfall.collections[:: 2 if take.physical else 1]
    assert len(bars) == 6
    for leg, bar in enumerate(bars):
        corners = [np.asarray(path.vertices) for path in bar.get_paths()]
        spans = [(np.min(corner[:, 0]), np.max(corner[:, 0])) for corner in corners]
        drawn = [any(low < end - step / 2 < high for low, high in spans) for end in time[: len(take.stance)]]
        assert np.array_equal(drawn, ~take.stance[:, leg])
        assert all(high <= time[len(take.stance) - 1] + 1e-9 for _, high in spans), "none after a fall"


def test_the_overlay_says_what_is_known(fallen, plan):
    """Signs and texts do not depend on colours."""
    take = Take.of(fallen)
    overlay, unstable = Overlay(take, Film(slow_motion=4.0), take.begin, take.end), int(np.argmax(take.margin <= 0))
    states = [overlay._state(row, seconds)[0] for row, seconds in ((0, 0.0), (unstable, take.lost), (0, take.fell))]
    assert [state[0] for state in states] == ["●", "▲", "■"]
    again = replace(take, margin=np.abs(take.margin))
    assert "stable (grounded loss at" in Overlay(again, Film(), 0.0, 1.0)._state(unstable, take.lost)[0]
    assert [margin_in_words(margin) for margin in (-1.25, -np.inf)] == ["margin -1.2 mm", "no foot stands"]
    frame = np.full((480, 640, 3), 200, dtype=np.uint8)
    overlay.draw(frame, 0, 0.15, 5.0)
    assert (frame[80:370] == 200).all() and (frame[400:463, 326:340] < 30).all(axis=(0, 2)).any(), "a line at the time"
    part = Take.of(plan.isel(step=slice(10, 40)))  # beside a longer recording
    overlay = Overlay(part, Film(), 0.0, 1.0)
    for seconds in (0.0, 1.0):
        assert overlay._state(0, seconds)[0] == f"recorded from {1e3 * part.begin:.0f} to {1e3 * part.end:.0f} ms"
    for row, seconds in ((0, part.begin), (29, part.end)):
        assert "stable" in overlay._state(row, seconds)[0]


@drawing
def test_high_quality_has_shadows(fallen, tmp_path):
    dark = {}
    for film in (Film(quality="fast", slow_motion=0.2), Film(quality="high", slow_motion=0.2)):
        render([fallen], tmp_path / "film.mp4", film)
        shot = scene(read_film(tmp_path / "film.mp4")[0][0])
        dark[film.quality] = ((shot < 150).all(axis=-1) & (np.ptp(shot, axis=-1) < 25)).mean()
    assert dark["high"] > 1.5 * dark["fast"]


@pytest.mark.parametrize("camera", STICK_INSECT.cameras)
@drawing
def test_the_insect_keeps_clear_of_the_diagram(camera, plan, tmp_path):
    """Legs and polygon neither reach the diagram nor the caption."""
    render([plan], tmp_path / "film.mp4", Film(camera=camera, slow_motion=0.5))
    for shot in scene(read_film(tmp_path / "film.mp4")[0]):
        for strip in (shot[:8], shot[-2:]):
            assert np.ptp(strip, axis=-1).max() < 30


@pytest.mark.parametrize(
    ("name", "value"),
    [("width", 641), ("height", 0), ("quality", "best"), ("fps", 0.0), ("slow_motion", -1.0)],
)
def test_bad_settings_are_refused(name: str, value: Any):
    with pytest.raises(InputError, match=name):
        Film(**{name: value})


def test_bad_films_are_refused(fallen, tmp_path):
    unseen = fallen.assign(qpos=fallen.qpos * np.nan)
    for recordings, name, film, argument in (
        ([fallen], "film.mp4", Film(camera="behind"), "camera"),
        ([], "film.mp4", Film(), "recordings"),
        ([fallen], "film.avi", Film(), "path"),
        ([unseen], "film.mp4", Film(), "a fall"),
        ([fallen.drop_vars("qpos")], "film.mp4", Film(), "qpos"),
    ):
        with pytest.raises(InputError, match=argument):
            render(recordings, tmp_path / name, film)
    assert not list(tmp_path.iterdir())


@drawing
def test_a_film_that_fails_leaves_the_old_one(fallen, tmp_path):
    path = tmp_path / "film.mp4"
    path.write_text("old")

    def fail(done: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render([fallen], path, SMALL, fail)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@drawing
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # mediapy leaves a pipe open
def test_a_missing_or_failing_ffmpeg_is_an_error(fallen, tmp_path, monkeypatch):
    for program in ("no-ffmpeg", "false"):  # a missing program, and one that stops with an error
        with monkeypatch.context() as changed, pytest.raises(RenderingError, match="ffmpeg"):
            changed.setenv("IMAGEIO_FFMPEG_EXE", shutil.which(program) or str(tmp_path / program))
            render([fallen], tmp_path / "film.mp4", SMALL)
    assert not list(tmp_path.iterdir())


@drawing
def test_a_closed_renderer_leaves_the_others_alone(plan):
    """Their textures have the same numbers, each in its own context."""
    take = Take.of(plan)
    model = compile_body(take.conditions).model
    first, second = gl.Renderer(model, 240, 320), gl.Renderer(model, 240, 320)
    stage = second, mujoco.MjData(model)
    before = _view(stage, "top", take, 0)[0].copy()
    _view((first, mujoco.MjData(model)), "side", take, 0)
    _view(stage, "top", take, 0)
    first.close()
    np.testing.assert_array_equal(_view(stage, "top", take, 0)[0], before)
    second.close()
    second.close()


def test_without_a_display_the_command_draws_with_egl_or_says_what_is_missing():
    kept = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
    kept["PYTHONPATH"] = os.pathsep.join(sys.path)
    program = (
        "import os; from hexmj.rendering import use_egl_without_display as use; before = dict(os.environ); {}\n"
        "from hexmj.rendering import gl; print(os.environ == before, gl.missing())"
    )
    for use, variables, expected in (
        ("use()", {}, "False None"),
        ("use()", {"MUJOCO_GL": "disable"}, "True This machine cannot render"),
        ("", {"MUJOCO_GL": "glfw"}, "True This machine cannot render"),
    ):
        words = [sys.executable, "-W", "error", "-c", program.format(use)]
        done = subprocess.run(words, env=kept | variables, capture_output=True, text=True, check=True)
        if gl.missing() is None or "None" not in expected:
            assert done.stdout.startswith(expected)
        assert done.stderr == ""
