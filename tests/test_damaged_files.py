"""Damaged, foreign and odd files: one sentence, never a traceback, a hang or other values."""

import io
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr

from drawing import drawing
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS, UNCOORDINATED
from hexmj.controllers.cruse1998.presets import network_toml
from hexmj.controllers.named import load_controller
from hexmj.errors import InputError, SimulationError
from hexmj.measures.kinematic import walk
from hexmj.measures.physical import physical_walk
from hexmj.paper.found_sets import found_sets
from hexmj.physics.divergence import replay, save_state
from hexmj.replay.film.film import Film
from hexmj.replay.film.video import render
from hexmj.replay.recording import load_recording, record, record_plan, save_recording
from hexmj.replay.take import takes_of
from hexmj.starts import draw_starts
from hexmj.storage import netcdf
from hexmj.storage.files import MARK, opened, read_sealed, sealed, unsealed
from hexmj.io import results_folder, save
from hexmj.sweep import Cell, CachedValues, run_cells
from hexmj.timing import Stride
from small_cells import squares


@pytest.fixture(scope="module")
def recording() -> xr.Dataset:
    return record_plan(walk(draw_starts(1, seed=3), LDVS, 0.4, 10.0), Conditions(), Stride(), title="a plan")


def numbers(seed: int) -> xr.Dataset:
    return xr.Dataset({"x": ("n", np.random.default_rng(seed).standard_normal(50))})


CELL = Cell("numbers", numbers, {"seed": 1})


def flipped(good: bytes, count: int) -> list[bytes]:
    """Copies with one bit of another value each, at seeded places; in the seal too."""
    draw = np.random.default_rng(5)
    places = [*draw.integers(len(good), size=count - 20), *draw.integers(len(good) - 79, len(good), size=20)]
    return [good[:at] + bytes([good[at] ^ 1 << draw.integers(8)]) + good[at + 1 :] for at in places]


def test_no_bit_of_a_recording_or_a_cell_can_change_unseen(recording, tmp_path):
    run_cells([CELL], tmp_path / "cells")
    (cell,) = (tmp_path / "cells").iterdir()
    path = save_recording(recording, tmp_path / "recording.nc")
    readers: dict[Path, Callable[[], Any]] = {
        path: lambda: load_recording(path),
        cell: lambda: run_cells([CELL], cell.parent),
    }
    for file, read in readers.items():
        good = file.read_bytes()
        for content in (*flipped(good, 200), b"", good[:-1], good[:100], good + b"\0", MARK, good[-80:]):
            file.write_bytes(content)
            with pytest.raises(InputError, match=rf"{re.escape(str(file))} is damaged"):
                read()
        file.write_bytes(good)
        read()


def test_sealed_content_comes_back_and_nothing_else_does():
    for content in (b"", b"x", MARK, bytes(range(256)) * 9):
        assert unsealed(sealed(content)) == content
        assert unsealed(content) is None
        assert unsealed(sealed(content)[:-1]) is None


def changed(recording: xr.Dataset, **values: Any) -> xr.Dataset:
    """With attributes of other values, or variables whose values are other ones."""
    attributes = {name: value for name, value in values.items() if name not in recording.variables}
    tables = {name: (recording[name].dims, value) for name, value in values.items() if name in recording.variables}
    return recording.assign(tables).assign_attrs(attributes)


def last(recording: xr.Dataset, name: str, value: float) -> np.ndarray:
    """The values of a variable, the last of which is another one."""
    values = recording[name].values.copy()
    values.flat[-1] = value
    return values


FALSE: dict[str, tuple[Callable[[xr.Dataset], xr.Dataset], str]] = {
    "endless": (lambda r: changed(r, seconds=np.full(100, 1e300)), "seconds holds 1e.300; expected 0 to 1e.07 s"),
    "longer": (lambda r: changed(r, seconds=r.seconds.values * 1e4), "seconds are not time over vp"),
    "holed": (lambda r: r.isel(step=[*range(50), *range(60, 100)]), "time is not that of 90 steps"),
    "empty": (lambda r: r.isel(step=slice(0)), "time is float64 of .'step': 0."),
    "dt": (lambda r: changed(r, dt=-1.0), "dt = -1.0; expected a time step of at least 1e-05"),
    "vp": (lambda r: changed(r, vp=1e-300), "seconds are not time"),
    "slow": (lambda r: changed(r, vp=1e-3, seconds=r.seconds.values * 8e4), "vp = 0.001; expected above 0.1"),
    "text": (lambda r: changed(r, friction="False"), "attribute friction = 'False'; expected one such as 1.0"),
    "bool": (lambda r: changed(r, friction=True), "attribute friction = True"),
    "part": (lambda r: changed(r, ground_seed=0.5), "attribute ground_seed = 0.5; expected one such as 0"),
    "infinite": (lambda r: changed(r, load=np.inf), "attribute load = inf"),
    "lines": (lambda r: changed(r, origins=[1.0, 2.0]), "attribute origins = "),
    "ground": (lambda r: changed(r, ground="sea"), "ground = 'sea'; valid names: flat"),
    "quaternion": (lambda r: changed(r, qpos=r.qpos.values * 0), "quaternion that is not of unit length"),
    "nan": (lambda r: changed(r, velocity=last(r, "velocity", np.nan)), "velocity holds nan; expected 0 to 1 V_p"),
    "gap": (lambda r: changed(r, centre_of_mass=last(r, "centre_of_mass", np.nan)), "centre_of_mass holds nan"),
    "far": (lambda r: changed(r, qpos=last(r, "qpos", 1e300)), "qpos holds 1e.300"),
    "joint unknown": (lambda r: changed(r, qpos=last(r, "qpos", np.nan)), "of which qpos is not finite throughout"),
    "joint beyond": (lambda r: changed(r, qpos=last(r, "qpos", np.inf)), "of which qpos is not finite throughout"),
    "fast": (lambda r: changed(r, velocity=last(r, "velocity", 2.0)), "velocity holds 2.0; expected 0 to 1"),
    "whole": (lambda r: r.assign(velocity=r.velocity.astype(int)), "velocity is int64 of .*; expected float64 over"),
    "turned": (
        lambda r: r.transpose("leg", ...),
        r"planned_x is float64 of .*; expected float64 over \('step', 'leg'\)",
    ),
    "legs": (lambda r: r.assign_coords(leg=list("abcdef")), "leg = .'a'.*; expected .'L1'"),
    "lines of a title": (lambda r: changed(r, title="a\nb"), "title = 'a.*; expected at most 1000 printable"),
    "nameless": (lambda r: r.drop_vars("leg"), "leg = None; expected"),
}


@pytest.mark.parametrize("kind", FALSE)
@drawing
def test_a_recording_that_makes_no_sense_is_neither_written_read_nor_filmed(recording, tmp_path, kind):
    change, said = FALSE[kind]
    false, path = change(recording), tmp_path / "recording.nc"
    with pytest.raises(InputError, match=said):
        save_recording(false, path)
    assert not path.exists()
    with pytest.raises(InputError, match=said):
        render([false], tmp_path / "film.mp4", Film(width=64, height=64))
    if kind == "bool":
        return  # NetCDF has no such attribute
    path.write_bytes(sealed(netcdf.encode(false)))
    with pytest.raises(InputError, match=rf"^{re.escape(str(path))}: .*{said}"):
        load_recording(path)


def test_a_fall_is_where_the_poses_end_and_has_its_part(tmp_path):
    walked = record(physical_walk(draw_starts(1, 0), LDVS, 0.3, 10.0))
    for values, said in {
        "100 poses are known; expected the 30 before fall_time = 3": {"fall_time": 3.0, "fall_part": 4},
        "fall_time = inf and fall_part = 4; expected a fall to have its part": {"fall_part": 4},
    }.items():
        with pytest.raises(InputError, match=values):
            save_recording(changed(walked, **said), tmp_path / "recording.nc")
    fallen = record(physical_walk(draw_starts(1, 0), UNCOORDINATED, 0.7, 30.0))
    with pytest.raises(InputError, match=r"^a recording has fall_part = 9; expected 0 to 4, or -1 for none$"):
        takes_of([changed(fallen, fall_part=9)])


def test_a_recording_that_was_edited_is_written_again(recording, tmp_path):
    """As docs tell: with xarray, then `save_recording`; what another program wrote bears no checksum."""
    path = save_recording(recording, tmp_path / "recording.nc")
    with xr.open_dataset(path, engine="h5netcdf") as opened_by_xarray:
        edited = opened_by_xarray.load().assign_attrs(title="another")
    edited.to_netcdf(tmp_path / "plain.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"not written by hexmj\.save_recording"):
        load_recording(tmp_path / "plain.nc")
    assert load_recording(save_recording(edited, path)).attrs["title"] == "another"


def test_a_small_file_that_claims_to_be_large_allocates_nothing(recording, tmp_path):
    """1e9 steps in some kB: chunks that were never written."""
    content = io.BytesIO(netcdf.encode(recording))
    with h5py.File(content, "a") as file:
        del file["qpos"]
        file.create_dataset("qpos", (10**9, 25), "f8", chunks=(1000, 25))
    path = tmp_path / "recording.nc"
    path.write_bytes(sealed(content.getvalue()))
    assert path.stat().st_size < 200_000
    with pytest.raises(InputError, match=r"recording\.nc is damaged"):
        load_recording(path)


def test_sealed_rubbish_is_a_sentence(tmp_path):
    for i, content in enumerate((b"", b"rubbish", b"\x89HDF\r\n\x1a\n" + bytes(500))):
        path = tmp_path / f"{i}.nc"
        path.write_bytes(sealed(content))
        with pytest.raises(InputError, match=rf"{i}\.nc is damaged, or was not written"):
            load_recording(path)


def odd(folder: Path, kind: str) -> Path:
    """Something at a path that is no file to read."""
    path = folder / "odd"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        return Path("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "dangling link":
        path.symlink_to(folder / "nothing")
    elif kind == "link to itself":
        path.symlink_to(path)
    elif kind == "too long a name":
        return folder / ("x" * 300)
    elif kind == "no file below a file":
        path.write_bytes(b"")
        return path / "below"
    else:
        with path.open("wb") as file:  # 5 GB that take no room
            file.truncate(5 * 10**9)
    return path


ODD = (
    *("pipe", "device", "folder", "dangling link", "link to itself", "too long a name", "no file below a file"),
    "5 GB",
)


@pytest.mark.parametrize("kind", ODD)
def test_odd_files_are_one_sentence_and_no_hang(tmp_path, kind):
    path = odd(tmp_path, kind)
    readers: tuple[Callable[[Path], object], ...] = (
        load_recording,
        replay,
        found_sets,
        lambda one: load_controller(str(one)),
    )
    for read in readers:
        with pytest.raises(InputError) as error:
            read(path)
        assert "\n" not in str(error.value)
    kept = tmp_path / "kept"
    CachedValues(ledger := Cell("squares", squares, {}), kept)
    (lines,) = kept.iterdir()
    lines.unlink()
    lines.symlink_to(path)
    with pytest.raises(InputError):
        CachedValues(ledger, kept)


def test_a_file_that_nobody_may_read(tmp_path, monkeypatch):
    """Mode 000 stops everybody but the superuser, who may run this test."""
    (path := tmp_path / "file").write_bytes(b"")

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("hexmj.storage.files.os.open", refuse)
    with pytest.raises(InputError, match=r"file cannot be read: Permission denied$"), opened(path):
        pass
    with pytest.raises(InputError, match="Permission denied"):
        read_sealed(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"\xff\xfe", "is no text in UTF-8"),
        (b"[" * 100_000, "cannot be read as TOML"),
        (b"a = " + b"9" * 10_000, "cannot be read as TOML"),
        (b"#" * 2_000_000, "is longer than 1 MB; expected a shorter text"),
    ],
    ids=["bytes", "deep", "long number", "long"],
)
def test_texts_that_no_person_would_write(tmp_path, text, said):
    (path := tmp_path / "weights.toml").write_bytes(text)
    with pytest.raises(InputError, match=said):
        load_controller(str(path))


def test_a_seed_of_any_size_is_written(tmp_path):
    path = save(xr.Dataset(attrs={"seed": 2**70, "other": -(2**63) + 1}), tmp_path / "a.nc")
    assert xr.load_dataset(path).attrs == {"seed": str(2**70), "other": -(2**63) + 1}


def test_a_text_with_a_byte_order_mark_is_one(tmp_path):
    (path := tmp_path / "weights.toml").write_bytes(b"\xef\xbb\xbf" + network_toml(LDVS).encode())
    assert load_controller(str(path)) == replace(LDVS, name="weights")


def test_a_damaged_state_is_not_replayed(tmp_path):
    path = save_state(SimulationError("it diverged", {"qpos": np.arange(3.0)}, "state.npz"), tmp_path)
    assert np.load(path)["qpos"].tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(InputError, match=r"state\.npz is no state of the body 'stick_insect'"):
        replay(path)
    for content in flipped(path.read_bytes(), 40):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"state\.npz is damaged"):
            replay(path)
    with pytest.raises(InputError, match=r"a\.nc is no state that a simulation left; expected a file of arrays, \.npz"):
        replay(save(xr.Dataset(), tmp_path / "a.nc"))


def test_names_are_shown_as_they_are(run, tmp_path, monkeypatch):
    name = "[red]$$"
    monkeypatch.chdir(tmp_path)
    Path(f"{name}.toml").write_text("[symmetric]\np1_i = 1.0\n")
    words = ["flss", "--model", f"{name}.toml", "--starts", "5", "--velocities", "0.5", "--out", name]
    code, out, error = run_cells(*words)
    assert code == 0, error
    assert f"{name}/flss.nc" in "".join(out.split("\n"))
    assert xr.load_dataset(Path(name) / "flss.nc", engine="h5netcdf").attrs["model"] == f"{name}.toml"


@pytest.mark.parametrize("name", ["a\nb", "\x1b[31mred", "\udcff", "x" * 5000], ids=["line", "colour", "bytes", "book"])
def test_words_that_nobody_reads_are_refused(run, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    code, _, error = run_cells("flss", "--model", name)
    assert code == 2
    assert error.count("\n") == 1
    assert error.strip().isprintable()
    assert len(error) < 1100
    assert "printable characters" in error


def test_folders_that_cannot_take_results(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    for path, said in {
        tmp_path / "file": "is a file; expected a folder",
        tmp_path / "file" / "below": "is a file; expected a folder",
        tmp_path / "dangling": "dangling is a link to nothing; expected a folder",
        tmp_path / "new" / ".." / "data": "leads through .*new, which is not there; expected a folder",
        tmp_path / "new" / ("x" * 300): "File name too long",
        Path("/proc/none"): "cannot be written to",
    }.items():
        with pytest.raises(InputError, match=said):
            results_folder(path, ["data.nc"])
    before = sorted(tmp_path.iterdir())
    results_folder(tmp_path / "new" / "and below", ["data.nc"])
    assert sorted(tmp_path.iterdir()) == before, "trying leaves nothing"
    monkeypatch.chdir(tmp_path)
    assert save(xr.Dataset(), Path("x" * 252 + ".nc")).is_file(), "the longest name there is"
