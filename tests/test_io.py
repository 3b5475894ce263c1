"""Results on disk: NetCDF with all bits, atomic files, settings as plain data, manifests."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.errors import InputError
from hexmj.files import read_netcdf, read_toml, replacing, write_netcdf, write_text
from hexmj.io import json_text, markdown_table, save_manifest
from hexmj.plain import plain
from small_cells import assert_same_bits, odd_bits


def test_netcdf_keeps_all_bits(tmp_path: Path) -> None:
    data = odd_bits(1)
    assert_same_bits([read_netcdf(write_netcdf(data, tmp_path / "a.nc"))], [data])


@pytest.mark.parametrize("controller", [hexmj.LDVS, hexmj.load_controller("wilson")])
def test_a_result_stays_what_it_is(tmp_path: Path, controller) -> None:
    result = hexmj.flss(controller, [0.3, 0.5], n_starts=40, seed=2**70)
    again = hexmj.load(hexmj.save(result, tmp_path / "a.nc"))
    assert again.identical(result) and hexmj.settings(again) == hexmj.settings(result)
    assert hexmj.settings(again)["seed"] == 2**70


@pytest.mark.parametrize("content", [None, b"", b"CDF\x01", b"no NetCDF", "cut"])
def test_files_that_are_no_netcdf_are_refused(tmp_path: Path, content) -> None:
    path = write_netcdf(odd_bits(1), tmp_path / "a.nc")
    if content is None:
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:-200] if content == "cut" else content)
    with pytest.raises(InputError):
        hexmj.load(path)


@pytest.mark.parametrize("content", ["[", "a = ", "\x00"])
def test_files_that_are_no_toml_are_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "a").write_text(content)
    for name in ("a", "missing"):
        with pytest.raises(InputError):
            read_toml(tmp_path / name)


def test_what_netcdf_cannot_hold_is_refused_and_the_old_file_stays(tmp_path: Path) -> None:
    path = write_netcdf(odd_bits(1), tmp_path / "a.nc")
    before = path.read_bytes()
    with pytest.raises(InputError):
        write_netcdf(xr.Dataset({"a": 1.0}, attrs={"b": {"c": 1}}), path)
    assert path.read_bytes() == before and [*tmp_path.iterdir()] == [path]


def test_a_write_that_fails_leaves_the_old_file_and_no_other(tmp_path: Path) -> None:
    path = write_text(tmp_path / "a.txt", "old")
    with pytest.raises(OSError), replacing(path) as part:
        part.write_text("ne")
        raise OSError(28, "No space left on device")
    assert path.read_text() == "old" and [*tmp_path.iterdir()] == [path]


@dataclass(frozen=True)
class Setting:
    gains: np.ndarray
    pair: tuple[int, float]
    nested: dict[str, object]
    file: str


def test_settings_become_plain_json(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("1")
    values = np.array([[1.0, 2.0]]), (1, 2.5), {"a": None, "b": np.float64(3.0)}, str(tmp_path / "table.csv")
    setting = plain(Setting(*values))
    assert json.loads(json.dumps(setting)) == setting
    assert setting["gains"] == [[1.0, 2.0]] and setting["nested"]["b"] == 3.0
    (tmp_path / "table.csv").write_text("2")
    assert plain(Setting(*values))["file"] != setting["file"]
    with pytest.raises(InputError):
        plain({"a": object()})


def test_json_has_null_for_numbers_that_are_not_finite() -> None:
    assert json.loads(json_text({"a": [float("nan"), float("inf"), 1.0], "b": Path("c")})) == {
        "a": [None, None, 1.0],
        "b": "c",
    }


def test_a_manifest_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = save_manifest(["flss", "--json"], {"seed": 1}, [tmp_path / "a" / "b.nc"], tmp_path / "manifest.json")
    manifest = json.loads(path.read_text())
    assert (manifest["command"], manifest["settings"], manifest["files"]) == (
        ["flss", "--json"],
        {"seed": 1},
        ["a/b.nc"],
    )
    assert manifest["versions"]["hexmj"] == hexmj.__version__


def test_a_markdown_table_keeps_bars_in_its_cells() -> None:
    assert markdown_table(["a", "b"], [["1", "2|3"]]) == ["| a | b |", "| --- | --- |", r"| 1 | 2\|3 |"]
