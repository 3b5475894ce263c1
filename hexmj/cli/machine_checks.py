"""Is this machine fit for the work?  Each check tells what it found, or fails and names a remedy."""

import os
import platform
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path
from typing import Any

from hexmj.rendering.gl import PACKAGES
from hexmj.threads import cores

QUOTA = Path("/sys/fs/cgroup/cpu.max")
"""Where Linux tells how much processor time a container gets: microseconds of it, or max, in each period; elsewhere
there is no such file, and no quota."""

RENDERING = """
import mujoco
from hexmj.bodies.mjcf import compile_body
from hexmj.conditions import Conditions
from hexmj.rendering import gl
model = compile_body(Conditions()).model
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with gl.renderer(model, 48, 64) as renderer:
    renderer.update_scene(data, "side")
    assert renderer.render().std() > 1, "the frame is empty"
print(gl.context_type().__module__)
"""
"""Renders a frame in a process of its own, since a driver may end it."""


class Unfit(Exception):
    """What is wrong with the machine."""


class LeftOut(Exception):
    """What an extra brings that is not installed."""


@dataclass(frozen=True)
class Finding:
    """What one check has found."""

    name: str
    """What was checked."""
    well: bool
    """Whether it is as it should be."""
    found: str
    """What was found, or what went wrong."""
    remedy: str = ""
    """What to do; empty where all is well."""
    note: bool = False
    """Whether it was left out, by somebody who may not need it."""


def examine() -> Iterator[Finding]:
    """Every check in turn; a check that fails in any way is a finding, and the next one follows."""
    for name, (check, remedy) in CHECKS.items():
        try:
            yield Finding(name, True, check())
        except LeftOut as told:
            yield Finding(name, True, str(told), note=True)
        except Exception as error:  # whatever the library, driver or operating system raises
            told = textwrap.shorten(str(error) or type(error).__name__, 200, placeholder=" [...]")
            yield Finding(name, False, told, remedy)


def versions() -> str:
    """Python and the packages lie within the bounds of `hexmj` itself."""
    from packaging.requirements import Requirement
    from packaging.specifiers import SpecifierSet

    python, wanted = platform.python_version(), metadata("hexmj")["Requires-Python"]
    wrong = [] if SpecifierSet(wanted).contains(python) else [f"Python {python}, expected {wanted}"]
    found = {}
    for requirement in map(Requirement, requires("hexmj") or []):
        if requirement.marker and not requirement.marker.evaluate({"extra": ""}):
            continue  # of an extra
        name, bounds = requirement.name, requirement.specifier
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            wrong.append(f"{name} is not installed")
            continue
        if not bounds.contains(found[name], prereleases=True):
            wrong.append(f"{name} {found[name]}, expected {bounds}")
    if wrong:
        raise Unfit("; ".join(wrong))
    return f"Python {python}, mujoco {found['mujoco']} and {len(found) - 1} more packages within their bounds"


def threads() -> str:
    """A thread per core that this process may use finds a core free: no quota is smaller, and Dask finds the cores."""
    count, (share, period) = cores(), _quota()
    if share != "max" and int(share) < count * int(period):
        raise Unfit(f"{count} threads would share {int(share) / int(period):g} cores, which is all that are granted")
    return f"{count}, one for each core that may be used (of {os.cpu_count()})"


def rendering() -> str:
    """MuJoCo renders a frame, as films are rendered."""
    from hexmj.rendering.gl import vain_wish

    if told := vain_wish():
        raise Unfit(told)
    script = f"import sys\nsys.path.append({str(Path(__file__).parents[2])!r}){RENDERING}"
    command = [sys.executable, "-P", "-c", script]  # without what lies in the current folder
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    if done.returncode != 0:
        raise Unfit((done.stderr.strip().splitlines() or [f"the process ended with {done.returncode}"])[-1])
    return f"a frame of 64 x 48 by {done.stdout.strip()}"


def films() -> str:
    """ffmpeg encodes two frames, which can be read back."""
    import numpy as np

    from hexmj.replay.film.encoder import encoder, missing

    if reason := missing():
        raise LeftOut(reason)
    import imageio_ffmpeg

    ffmpeg, frames = imageio_ffmpeg.get_ffmpeg_exe(), np.zeros((2, 48, 64, 3), np.uint8)
    frames[1] = 255
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        with encoder(path, 48, 64, 25.0) as add:
            for frame in frames:
                add(frame)
        decode = [ffmpeg, "-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
        read = np.frombuffer(subprocess.run(decode, capture_output=True, check=True).stdout, np.uint8)
    if read.size != frames.size or abs(read.reshape(frames.shape).astype(int) - frames).max() > 10:
        raise Unfit("two frames were encoded, but do not come back as they were")
    return f"two frames through {Path(ffmpeg).name}"


def compiled() -> str:
    """What Numba compiles is kept, so that only the first call takes long."""
    from hexmj.controllers.cruse1998 import kernel

    record: Any = kernel.record
    if not hasattr(record, "stats"):
        raise Unfit("nothing is compiled, for NUMBA_DISABLE_JIT is set, and walks take far longer")
    folder = record.stats.cache_path
    try:
        with tempfile.TemporaryFile(dir=folder):
            return f"kept in {folder}"
    except OSError as error:
        raise Unfit(f"{folder}: {error.strerror}") from None


def walking() -> str:
    """Two insects walk and do not fall, to the same bits on one thread and on all."""
    import numpy as np

    from hexmj.controllers.cruse1998 import LDVS
    from hexmj.measures.physical import physical_walk
    from hexmj.starts import draw_starts

    alone, together = (physical_walk(draw_starts(2, 0), LDVS, 0.1, 20.0, threads=n) for n in (1, None))
    if np.isfinite(alone.outcomes.fall).any():
        raise Unfit("an insect fell that does not fall elsewhere")
    if not np.array_equal(alone.qpos, together.qpos):
        raise Unfit("one thread and several do not walk to the same bits")
    return "two insects for 20 time units, the same bits on one thread and on all"


CHECKS: dict[str, tuple[Callable[[], str], str]] = {
    "versions": (versions, "install hexmj into a fresh environment (make test, make compare), Python 3.11 or newer"),
    "threads": (threads, "mount /proc where it is not; give --threads with the number of cores that are granted"),
    "rendering": (
        rendering,
        f"install {PACKAGES} and leave MUJOCO_GL and PYOPENGL_PLATFORM unset, or set both to egl; only films need it",
    ),
    "films": (films, "reinstall imageio-ffmpeg, or set IMAGEIO_FFMPEG_EXE to an ffmpeg with H.264; only films need it"),
    "compiled code": (compiled, "leave NUMBA_DISABLE_JIT unset, and set NUMBA_CACHE_DIR to a folder that is writable"),
    "walking": (walking, "mend what else is WRONG, or reinstall mujoco and numba; if it stays, report it"),
}
"""Name of a check -> the check, and what to do where it fails."""


def _quota() -> list[str]:
    try:
        return QUOTA.read_text().split()
    except OSError:  # no container, or one that tells it elsewhere
        return ["max", "0"]
