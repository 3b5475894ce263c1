"""A disk that is full, at whatever moment: one sentence, nothing half written, and what was finished stays."""

import errno
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import hexmj
from hexmj.cli.flss import Flss
from hexmj.cli.manifest import save_manifest
from hexmj.errors import InputError
from hexmj.replay.film.encoder import encoder
from hexmj.storage.files import is_as_written, replacing, write_whole
from hexmj.files import write_text
from hexmj.io import save, save_figure
from hexmj.sweep import Cell, CachedValues, run_cells
from small_cells import squares
from tiers import few_of

ROOM = 30_000
"""Bytes that a full disk still takes of a file."""


@contextmanager
def little_room(most: int = ROOM) -> Iterator[None]:
    """No file can be longer, which the system tells as it tells of a full disk: when it is written."""
    usual, compiles = resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode
    sys.dont_write_bytecode = True  # Python would keep half of a module, and read that ever after
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, usual[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
        sys.dont_write_bytecode = compiles


def numbers(seed: int, size: int) -> xr.Dataset:
    return xr.Dataset({"x": ("n", np.random.default_rng(seed).standard_normal(size))})


def cells(size: int) -> list[Cell]:
    """A small one, and one of some size."""
    return [Cell(f"numbers {i}", numbers, {"seed": i, "size": n}) for i, n in enumerate((5, size))]


def figure() -> Figure:
    drawn = Figure()
    drawn.subplots().imshow(np.random.default_rng(0).random((200, 200)))
    return drawn


def noise(path: Path) -> None:
    """A film of what cannot be compressed."""
    draw = np.random.default_rng(0)
    with replacing(path) as part, encoder(part, 128, 128, 30.0) as add:
        for _ in range(60):
            add(draw.integers(256, size=(128, 128, 3), dtype=np.uint8))


WRITERS: dict[str, Callable[[Path], object]] = {
    "data.nc": lambda path: save(numbers(0, 10_000), path),
    "figure.png": lambda path: save_figure(figure(), path),
    "figure.pdf": lambda path: save_figure(figure(), path, dpi=300),
    "manifest.json": lambda path: save_manifest(Flss(), {"many": list(range(10_000))}, (), path),
    "found.toml": lambda path: write_text(path, "# long\n" * 10_000),
    "film.mp4": noise,
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_does_not_fit_is_a_sentence_and_leaves_what_was_there(tmp_path, name):
    (path := tmp_path / name).write_text("precious")
    with little_room(), pytest.raises(InputError, match=rf"{re.escape(name)} cannot be written: \S"):
        WRITERS[name](path)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]
    WRITERS[name](path)
    assert path.stat().st_size > ROOM


def test_a_film_that_does_not_fit_says_why(tmp_path):
    """ffmpeg is ended by a signal then, and says nothing."""
    with little_room(), pytest.raises(InputError, match=r"film.mp4 cannot be written: ffmpeg ended \(File size limit"):
        noise(tmp_path / "film.mp4")


def test_a_manifest_names_nothing_that_is_gone(tmp_path):
    with pytest.raises(InputError, match=r"gone\.nc was removed or renamed while the command ran; expected it to stay"):
        save_manifest(Flss(), {}, [tmp_path / "gone.nc"], tmp_path / "manifest.json")
    assert not list(tmp_path.iterdir())
    write_whole(tmp_path / "ours.nc", b"ours").write_bytes(b"another command's")
    with pytest.raises(InputError, match=r"ours\.nc was written by something else while the command ran; expected it"):
        save_manifest(Flss(), {}, [tmp_path / "ours.nc"], tmp_path / "manifest.json")


def test_what_a_command_alone_has_written_is_not_read_again(tmp_path, monkeypatch):
    """Else cells of the code that calls commands would count it as what that reads."""
    monkeypatch.setattr("hexmj.storage.files.digest_of", None)
    assert is_as_written(write_whole(tmp_path / "ours.nc", b"ours"))


def test_another_content_is_told_whatever_its_time(tmp_path):
    file = write_whole(tmp_path / "ours.nc", b"ours")
    before = file.stat()
    time.sleep(0.05)
    with file.open("r+b") as edited:
        edited.write(b"else")
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert not is_as_written(file)


def test_finished_cells_stay_where_the_next_does_not_fit(tmp_path):
    with little_room(), pytest.raises(InputError, match=r"numbers-1-.*\.nc cannot be written: File too large"):
        run_cells(cells(10_000), tmp_path)
    (kept,) = tmp_path.iterdir()
    before = kept.read_bytes()
    assert [one.sizes["n"] for one in run_cells(cells(10_000), tmp_path)] == [5, 10_000]
    assert kept.read_bytes() == before


@pytest.mark.parametrize("room", [0, 10, 800, 3000, 20_000])
def test_evaluations_go_on_wherever_the_disk_was_full(tmp_path, room):
    rows = np.random.default_rng(1).standard_normal((300, 4))
    with little_room(room), pytest.raises(InputError, match="cannot be written"):
        CachedValues(Cell("squares", squares, {}), tmp_path)(rows)
    again = CachedValues(Cell("squares", squares, {}), tmp_path)
    assert again(rows).tobytes() == squares(rows).tobytes()
    held = CachedValues(Cell("squares", squares, {}), tmp_path)
    assert held(rows[::-1]).tobytes() == squares(rows[::-1]).tobytes()
    assert held.replayed == 300


WALK = ("walk", "--observation time", "40", "--velocity", "0.5", "--out")


@pytest.mark.slow
@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_every_file_of_a_command_may_be_the_one_that_does_not_fit(run, tmp_path, monkeypatch, call):
    """In turn: the n-th is refused, so those before it are there and whole."""
    usual, files = getattr(os, call), ("recording.nc", "walk.png", "manifest.json")
    for n in range(len(files)):
        left = n

        def fill(*words: object) -> None:
            nonlocal left
            left -= 1
            if left < 0:
                raise OSError(errno.ENOSPC, "No space left on device")
            usual(*words)

        monkeypatch.setattr(os, call, fill)
        code, out, error = run_cells(*WALK, out_folder := tmp_path / f"{n}")
        monkeypatch.setattr(os, call, usual)
        assert (code, out) == (2, "")
        assert error.strip() == f"hexmj: {out_folder / files[n]} cannot be written: No space left on device"
        assert sorted(path.name for path in out_folder.iterdir()) == sorted(files[:n])


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """A file system of 1 MB, where one may be mounted."""
    (folder := tmp_path / "disk").mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "none", folder], capture_output=True).returncode:
        pytest.skip("no file system can be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_disk_that_is_really_full(run, small_disk):
    """Room for nothing, then for more: a part of the recording, the whole, but not the figure."""
    fill = small_disk / "fill"
    with fill.open("wb", buffering=0) as file, pytest.raises(OSError, match="No space left"):
        while True:
            file.write(bytes(4096))
    for room, left in ((0, []), (100_000, []), (150_000, ["recording.nc"])):
        os.truncate(fill, fill.stat().st_size - room)
        code, out, error = run_cells(*WALK, small_disk / "out")
        assert (code, out) == (2, "")
        assert "cannot be written" in error
        assert "No space left on device" in error
        assert [path.name for path in small_disk.rglob("*.*")] == left


def hexmj_into(stream: str, *words: str) -> subprocess.CompletedProcess[bytes]:
    """The command, its standard output redirected by a shell."""
    environment = os.environ | {"PYTHONPATH": str(Path(hexmj.__file__).parents[1])}
    command = f'"$@" {stream}'
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", command, "_", sys.executable, "-m", "hexmj", *words],
        env=environment, capture_output=True, preexec_fn=lambda: signal.signal(signal.SIGPIPE, signal.SIG_DFL),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("words", few_of(["--help", "flss --starts 5 --json"], "--help"))
def test_standard_output_that_is_full_or_gone(words):
    full = hexmj_into("> /dev/full", *words.split())
    assert full.returncode == 2
    assert full.stderr.strip().splitlines()[-1:] == [b"hexmj: standard output: No space left on device"]
    gone = hexmj_into("| true", *words.split())
    assert gone.returncode in (0, 141)
    progress = [line for line in gone.stderr.splitlines() if line.startswith(b"kinematic FLSS: ")]  # of a slow machine
    assert gone.stderr.split() == b" ".join(progress).split()


def test_a_name_is_no_protocol(tmp_path, monkeypatch):
    """ffmpeg would take what stands before the colon for one."""
    monkeypatch.chdir(tmp_path)
    (folder := Path("2026-11-22T12:30")).mkdir()
    noise(folder / "http:film.mp4")
    assert [path.name for path in folder.iterdir()] == ["http:film.mp4"]


def test_a_name_that_cannot_be(tmp_path):
    with pytest.raises(InputError, match="cannot be written: File name too long"):
        write_whole(tmp_path / ("x" * 256), b"")
    assert list(tmp_path.iterdir()) == []
