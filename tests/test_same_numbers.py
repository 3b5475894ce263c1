"""Two files of results beside each other: every bit, key and axis counts."""

import numpy as np
import pytest
import xarray as xr

from hexmj.io import save
from hexmj.storage.same_numbers import Compared, compared


def test_every_bit_counts(tmp_path):
    """Zeros of both signs differ, not-a-number is itself, and infinity is far from everything."""
    nan, inf = np.nan, np.inf
    old = {"x": [0.0, nan, inf, 1.0, 2.0], "n": [1, 2, 3, 4, 5], "t": list("abcde"), "b": [True] * 5, "gone": [0] * 5}
    new = {"x": [-0.0, nan, inf, 1.5, inf], "n": [1, 2, 3, 4, 7], "t": list("abcdx"), "b": [True] * 5, "came": [0] * 5}
    for name, values in (("old", old), ("new", new)):
        data = xr.Dataset({key: ("i", one) for key, one in values.items()})
        save(data.assign_attrs(seed=len(name)), tmp_path / f"{name}.nc")
    assert sorted(compared(tmp_path / "old.nc", tmp_path / "new.nc"), key=lambda one: one.name) == [
        Compared("(attributes)", 1, 0, None),
        Compared("(structure)", 1, 1, None),
        Compared("b", 5, 0, None),
        Compared("came", 5, 5, None, "not there then"),
        Compared("gone", 5, 5, None, "not there now"),
        Compared("n", 5, 1, 2.0),
        Compared("t", 5, 1, None),
        Compared("x", 5, 3, inf),
    ]


def test_json_and_toml_are_compared_by_their_keys(tmp_path):
    (tmp_path / "old.json").write_text('{"claims": [{"key": "a", "value": 1.0}, {"key": "b", "value": null}], "n": 1}')
    (tmp_path / "new.json").write_text('{"claims": [{"key": "a", "value": 1.25}, {"key": "b", "value": 2}], "n": 1.0}')
    assert compared(tmp_path / "old.json", tmp_path / "new.json") == [
        Compared("claims.key", 2, 0, None),
        Compared("claims.value", 2, 2, np.inf),
        Compared("n", 1, 1, 0.0),
        Compared("(structure)", 1, 0, None),
    ]
    (tmp_path / "old.toml").write_text("[weights]\na = 0.1\nb = [1, 2]\n")
    (tmp_path / "new.toml").write_text("searched = { seeds = [0] }\n[weights]\na = 0.10000000000000002\nb = [1]\n")
    a, b, structure = compared(tmp_path / "old.toml", tmp_path / "new.toml")
    assert (a.differ, a.most) == (1, pytest.approx(1.4e-17, rel=0.1))
    assert (b.differ, b.misfit) == (2, "shape (2,) then, (1,) now")
    assert structure == Compared("(structure)", 1, 1, None)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('{"a": []}', "{}"),
        ("[[1, 2], [3]]", "[[1], [2, 3]]"),
        ('[{"a": 1}, {}]', '[{}, {"a": 1}]'),
    ],
)
def test_what_is_nested_otherwise_is_not_equal(tmp_path, old, new):
    paths = tmp_path / "old.json", tmp_path / "new.json"
    for path, text in zip(paths, (old, new), strict=True):
        path.write_text(text)
    assert [one.name for one in compared(*paths) if one.differ] == ["(structure)"]


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ('{"(structure)": 1}', '{"(structure)": 2}', ['"(structure)"']),
        ('{"a.b": 1}', '{"a": {"b": 1}}', ["(structure)", '"a.b"', "a.b"]),
        ('{"a.b": 1, "a": {"b": 2}}', '{"a": {"b": 1}, "a.b": 2}', ['"a.b"', "a.b"]),
    ],
)
def test_keys_that_look_like_others_are_their_own(tmp_path, old, new, names):
    paths = tmp_path / "old.json", tmp_path / "new.json"
    for path, text in zip(paths, (old, new), strict=True):
        path.write_text(text)
    assert [one.name for one in compared(*paths) if one.differ] == names


def test_the_order_of_keys_counts_for_nothing(tmp_path):
    (tmp_path / "old.json").write_text('{"a": 1, "b": {"c": 2, "d": 3}}')
    (tmp_path / "new.json").write_text('{"b": {"d": 3, "c": 2}, "a": 1}')
    assert not any(one.differ for one in compared(tmp_path / "old.json", tmp_path / "new.json"))


def test_a_variable_in_another_unit_is_not_equal(tmp_path):
    for name, units in (("old", "1"), ("new", "%")):
        save(xr.Dataset({"x": ("i", [1.0], {"units": units})}), tmp_path / f"{name}.nc")
    assert compared(tmp_path / "old.nc", tmp_path / "new.nc") == [
        Compared("x", 1, 0, None),
        Compared("(attributes)", 1, 1, None),
        Compared("(structure)", 1, 0, None),
    ]


def row(values: object, *axes: str, **attributes: object) -> xr.Dataset:
    return xr.Dataset({"a": (axes or "x", np.asarray(values), attributes)})


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        (row([1.0], k=[0.1, 0.2]), row([1.0], k=[0.1, 0.2 + 1e-12]), "(attributes)"),
        (row([1.0], k=np.zeros(2000)), row([1.0], k=np.eye(1, 2000, 1000)[0]), "(attributes)"),
        (row([1.0], k=np.array([1, 2], np.float32)), row([1.0], k=[1.0, 2.0]), "(attributes)"),
        (row([1.0], k="v"), row([1.0]).assign_attrs({"a.k": "v"}), "(attributes)"),
        (row(np.eye(2), "x", "y"), row(np.eye(2), "y", "x"), "(structure)"),
        (row([1.0]), row([1.0]).set_coords("a"), "(structure)"),
        (row([1.0]).rename(a="(attributes)"), row([2.0]).rename(a="(attributes)"), '"(attributes)"'),
    ],
)
def test_all_that_a_netcdf_file_tells_counts(tmp_path, old, new, name):
    paths = [save(one, tmp_path / f"{n}.nc") for n, one in enumerate((old, new))]
    assert [one.name for one in compared(*paths) if one.differ] == [name]


def test_digests_of_files_in_texts_are_the_manifests_to_compare(tmp_path):
    told = ["mine.py@0123456789ab.Tripod", "mine.py@ba9876543210.Tripod", "mine.py@ba9876543210.Wave"]
    paths = [save(row([1.0], k=one), tmp_path / f"{n}.nc") for n, one in enumerate(told)]
    assert not any(one.differ for one in compared(paths[0], paths[1]))
    assert [one.name for one in compared(paths[0], paths[2]) if one.differ] == ["(attributes)"]
