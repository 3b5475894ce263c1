"""Render the documentation's gallery: short films of walks, as animated WebP.

The script writes the films into `results/gallery`; `make gallery` writes them into `docs/images`.
"""

import subprocess
from argparse import ArgumentParser
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import servo_hexapod
from imageio_ffmpeg import get_ffmpeg_exe
from xarray import Dataset

import hexmj

FILM = hexmj.Film(width=480, height=360, fps=15.0, slow_motion=2.0)
SIDE = hexmj.Film(width=640, height=360, fps=15.0, slow_motion=1.0, camera="side")
TOP = hexmj.Film(width=400, height=400, fps=12.0, slow_motion=1.0, camera="top")
WIDE = hexmj.Film(width=640, height=360, fps=15.0, slow_motion=2.0)
GAITS = ("graham", "walknet-reacog", "own-0.5")


def walked(name: str, velocity: float | hexmj.Command, duration: float, **conditions: Any) -> Dataset:
    """Record a physical walk of the first start of seed 0, which follows V_r or a command."""
    starts, settings = hexmj.draw_starts(1, seed=0), hexmj.Conditions(**conditions)
    walk = hexmj.physical_walk(starts, hexmj.load_controller(name), velocity, duration, conditions=settings)
    return hexmj.record(walk, title=name)


def on_command(task: str, *names: str) -> list[Dataset]:
    """Record a walk of each controller by the command of a task."""
    settings = hexmj.load_task(task)
    return [walked(name, settings.command, float(settings.duration)) for name in names]


def planned(name: str, velocity: float, duration: float) -> Dataset:
    """Record a plan of the same start."""
    plan = hexmj.walk(hexmj.draw_starts(1, seed=0), hexmj.load_controller(name), velocity, duration)
    return hexmj.record_plan(plan, hexmj.Conditions(), hexmj.Stride(), title=f"{name}, planned")


def film(recordings: list[Dataset], path: Path, settings: hexmj.Film, body: hexmj.Body = hexmj.STICK_INSECT) -> None:
    """Render the recordings side by side into an animated picture that loops."""
    with TemporaryDirectory() as folder:
        video = Path(folder) / "film.mp4"
        frames = hexmj.render(recordings, video, settings, body=body)
        convert = ["-i", video, "-loop", "0", "-quality", "45", "-compression_level", "4", path]
        subprocess.run([get_ffmpeg_exe(), "-loglevel", "error", "-y", *map(str, convert)], check=True)
    print(f"{path}: {frames} frames, {path.stat().st_size / 1000:.0f} kB")


def main() -> None:
    """Render all films."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default="results/gallery", help="folder of the films")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    film([planned("ldvs", 0.4, 140.0), walked("ldvs", 0.4, 140.0)], out / "walk.webp", FILM)
    film([walked("uncoordinated", 0.5, 60.0), walked("ldvs", 0.5, 60.0)], out / "fall.webp", FILM)
    film([walked("ldvs", 0.4, 300.0, ground="step", ground_height=3.0, ground_at=60.0)], out / "step.webp", SIDE)
    film([walked(name, 0.5, 80.0) for name in GAITS], out / "gaits.webp", FILM)
    film(on_command("slalom", "graham"), out / "slalom.webp", TOP)
    film(on_command("turn", "ldvs", "graham"), out / "turn.webp", TOP)
    with TemporaryDirectory() as folder:
        body = servo_hexapod.robot(Path(folder))
        film([servo_hexapod.tilting(body)], out / "robot.webp", WIDE, body)


if __name__ == "__main__":
    main()
