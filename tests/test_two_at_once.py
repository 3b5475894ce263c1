"""Two runs in one folder: what is equal is welcome, what is not stays apart, and a search has its folder alone."""

import json
import os
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import xarray as xr

import hexmj
from hexmj.errors import InputError
from hexmj.storage.files import write_whole
from hexmj.storage.locks import locked
from hexmj.io import save


def command(*words: str) -> subprocess.Popen[bytes]:
    environment = os.environ | {"PYTHONPATH": str(Path(hexmj.__file__).parents[1])}
    return subprocess.Popen(
        [sys.executable, "-m", "hexmj", *words], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def test_many_writers_of_one_file_leave_one_whole_file(tmp_path):
    path, contents = tmp_path / "file", [bytes([i]) * (100_000 + i) for i in range(8)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda content: [write_whole(path, content) for _ in range(10)], contents))
    assert path.read_bytes() in contents
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.thorough
def test_two_commands_write_the_same_folder(tmp_path):
    words = ("compare", "--models", "ldvs", "--velocities", "0.5", "--starts", "4", "--observation time", "20", "--no-video")
    both = [command(*words, "--json", "--out", str(tmp_path)) for _ in range(2)]
    answers = [one.communicate() for one in both]
    assert [one.returncode for one in both] == [0, 0], answers
    assert json.loads(answers[0][0]) == json.loads(answers[1][0])
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "comparison.nc", "comparison.png", "manifest.json", "walks"
    ]  # fmt: skip
    assert [path.suffix for path in (tmp_path / "walks").iterdir()] == [".nc"]


@pytest.mark.slow
def test_a_running_search_has_its_folder_alone(tmp_path):
    words = ("search", "--starts", "500", "--refine-starts", "20000", "--out", str(tmp_path))
    first = command(*words)
    try:
        lock = tmp_path / "evaluations" / ".lock"
        while not (lock.exists() and lock.read_text()):
            assert first.poll() is None
            time.sleep(0.02)
        second = command(*words)
        out, error = second.communicate()
        assert (second.returncode, out) == (2, b"")
        holder = f"process {first.pid} on {socket.gethostname()}"
        assert f"hexmj: {lock.parent} is in use by {holder}; wait until it ends" in error.decode()
        assert lock.exists()
    finally:
        first.kill()
        first.communicate()
    with locked(lock.parent):
        assert lock.read_text() == f"process {os.getpid()} on {socket.gethostname()}", "a killed process holds nothing"
    assert not lock.exists()


def test_a_lock_is_held_by_one_at_a_time(tmp_path):
    (tmp_path / ".lock").write_bytes(b"\xff left behind")
    for _ in range(2):
        with (
            locked(tmp_path),
            pytest.raises(InputError, match=f"in use by process {os.getpid()} on "),
            locked(tmp_path),
        ):
            pass
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="cannot be written: Not a directory"), locked(Path(__file__) / "below"):
        pass


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_a_lock_that_is_a_link_empties_no_file(tmp_path, link):
    (precious := tmp_path / "precious").write_text("precious")
    link(precious, tmp_path / ".lock")
    with pytest.raises(InputError, match="cannot be written: "), locked(tmp_path):
        pass
    assert precious.read_text() == "precious"


def test_what_a_killed_writer_left_is_in_nobody_s_way(tmp_path):
    (tmp_path / ".part-0123.nc").write_bytes(b"half")
    data = xr.Dataset({"x": ("n", [1.0])})
    save(data, tmp_path / "data.nc")
    assert xr.load_dataset(tmp_path / "data.nc", engine="h5netcdf").identical(data)
