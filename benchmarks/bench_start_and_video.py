"""Start of the command line beside its imports, and the fast film beside MuJoCo's renderer."""

import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

from hexmj import LDVS, Film, draw_starts, physical_walk, record, render

COMMANDS = {
    "hexmj flss, one velocity": ("-m", "hexmj", "flss", "--velocity", "0.5"),
    "hexmj --help": ("-m", "hexmj", "--help"),
}
RATIOS = {"hexmj flss, one velocity": 0.3, "hexmj --help": 0.6}


@pytest.mark.parametrize("who", ["hexmj", "import numba, xarray"])
@pytest.mark.parametrize("what", COMMANDS)
def test_start(measure, what, who):
    """Later calls, in fresh processes."""
    command = COMMANDS[what] if who == "hexmj" else ("-c", "import numba, xarray")
    work = [sys.executable, *command]
    measure(lambda: subprocess.run(work, check=True, capture_output=True), what, who, ratio=RATIOS[what])


@pytest.mark.parametrize("who", ["hexmj", "bare mujoco.Renderer"])
def test_video(measure, tmp_path: Path, who):
    """640x480 with overlays, encoded; the peer only draws the scene."""
    film, walked = Film(), physical_walk(draw_starts(1, 0), LDVS, 0.3, 260.0)
    recording = record(walked)
    frames = render([recording], tmp_path / "gait.mp4", film)

    def bare() -> None:
        model = mujoco.MjModel.from_xml_path(str(walked.conditions.body.mjcf))
        model.light_castshadow[:] = False
        model.vis.quality.offsamples = 0
        data, qpos = mujoco.MjData(model), recording.qpos.values
        with mujoco.Renderer(model, film.height, film.width) as renderer:
            for frame in range(frames):
                data.qpos[:] = qpos[frame * len(qpos) // frames]
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, film.camera)
                renderer.render()

    work = bare if who != "hexmj" else lambda: render([recording], tmp_path / "gait.mp4", film)
    measure(work, "film, fast preset, 640x480", who, amount=frames, unit="frames/s", ratio=0.4, warm=False)
