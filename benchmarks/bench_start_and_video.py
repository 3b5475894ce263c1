"""Start-up of the command line in fresh processes, and frames a second of the fast preset."""

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

from hexmj import LDVS, Film, draw_starts, physical_walk, record, render
from hexmj.bodies.mjcf import compile_body
from hexmj.rendering import gl
from hexmj.replay.take import Take

FLSS = "-m", "hexmj", "flss", "--velocities", "0.5"
IMPORTS = "-c", "import numba, xarray"


def run(*arguments: str, **environment: str) -> None:
    subprocess.run([sys.executable, *arguments], env=os.environ | environment, check=True, capture_output=True)


def test_first_call(measure, tmp_path):
    measure(
        lambda: run(*FLSS, NUMBA_CACHE_DIR=str(tmp_path)),
        "hexmj flss, first call, compiles",
        bar=20.0,
        rounds=1,
        warm=False,
    )


@pytest.mark.parametrize("who", ["hexmj", "import numba, xarray"])
def test_later_calls(measure, who):
    measure(lambda: run(*(FLSS if who == "hexmj" else IMPORTS)), "hexmj flss, one velocity, later calls", who, bar=2.0)


@pytest.mark.parametrize("who", ["hexmj", "import numba, xarray"])
def test_help(measure, who):
    work = ("-m", "hexmj", "--help") if who == "hexmj" else IMPORTS
    measure(lambda: run(*work), "hexmj --help", who, bar=0.5)


@pytest.mark.parametrize("who", ["hexmj", "bare mujoco.Renderer"])
def test_video(measure, tmp_path: Path, who):
    """640x480 with overlays, encoded; the peer only draws the scene."""
    film, walk = Film(), record(physical_walk(draw_starts(1, 0), LDVS, 0.3, 260.0))
    frames = render([walk], tmp_path / "gait.mp4", film)

    def bare() -> None:
        take = Take.of(walk)
        model = compile_body(take.conditions).model
        model.light_castshadow[:] = False
        model.vis.quality.offsamples = 0
        data = mujoco.MjData(model)
        with gl.renderer(model, film.height, film.width) as renderer:
            for frame in range(frames):
                data.qpos[:] = take.qpos[take.row(frame / (film.fps * film.slow_motion))]
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, film.camera)
                renderer.render()

    work = bare if who != "hexmj" else lambda: render([walk], tmp_path / "gait.mp4", film)
    measure(work, "film, fast preset, 640x480", who, amount=frames, unit="frames/s", bar=40.0, warm=False)
