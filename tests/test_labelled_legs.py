"""Legs that xarray, pandas or another table labels are taken by their names, in whatever order they come; parameters
are refused in another order."""

from collections import deque
from dataclasses import asdict, replace
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import sparse

import hexmj
from hexmj.controllers.cruse1998.weights import general
from hexmj.legs import FIG1, LEGS, MIRROR
from hexmj.search.forms import FORMS
from hexmj.search.problems import Sample
from hexmj.walks import PlannedWalk

FEET = np.column_stack([FIG1.origin, FIG1.y])


def walk(starts: Any) -> PlannedWalk:
    return hexmj.walk(starts, hexmj.LDVS, 0.3, 5.0)


def test_labelled_legs_may_come_in_any_order():
    starts = hexmj.draw_starts(6, 0)
    labelled = xr.DataArray(starts, dims=("start", "leg"), coords={"leg": [*LEGS]})
    shuffled = ["L1", "R1", "L2", "R2", "L3", "R3"]
    table: Any = labelled.to_pandas()
    for given in (labelled.sel(leg=shuffled), labelled.T, table[shuffled], labelled.drop_vars("leg").T):
        assert np.array_equal(walk(given).x, walk(starts).x)
    assert not np.array_equal(walk(labelled.sel(leg=shuffled).to_numpy()).x, walk(starts).x)
    assert np.array_equal(walk(starts.data).x, walk(starts).x)
    assert np.array_equal(walk(labelled.assign_coords(leg=range(6))).x, walk(starts).x)
    with pytest.raises(hexmj.InputError, match=r"^starts have the shape \(6,\)"):
        walk(labelled[0])
    for labels in ([*"abcdef"], [*LEGS[:5], "L1"], [1, 0, 2, 3, 4, 5]):
        with pytest.raises(hexmj.InputError, match=r"^starts of the legs .*; expected L1, L2, L3, R1, R2, R3$"):
            walk(labelled.assign_coords(leg=labels))
    assert np.array_equal(walk(Table(table[shuffled])).x, walk(starts).x)
    numbered = labelled.drop_vars("leg").rename(leg="i").assign_coords(leg=(("start", "i"), starts))
    assert np.array_equal(walk(numbered).x, walk(starts).x)
    for axes in ({"leg": "dim_1"}, {"leg": "legs"}):
        assert np.array_equal(walk(labelled.sel(leg=shuffled).rename(axes).T).x, walk(starts).x)
    foot = labelled.drop_vars("leg").rename(leg="k")
    for axis, labels in (("k", shuffled), ("foot", shuffled), ("foot", [*LEGS[:5], "L1"]), ("k", ["l1", *LEGS[1:]])):
        given = foot.sel(k=[LEGS.index(one.upper()) for one in labels]).assign_coords({axis: ("k", labels)})
        if {*labels} == {*LEGS}:
            assert np.array_equal(walk(given).x, walk(starts).x)
            continue
        with pytest.raises(hexmj.InputError, match=r"^starts of the legs .*; expected L1, L2, L3, R1, R2, R3$"):
            walk(given)
    tips = labelled.sel(leg=shuffled).rename(leg="tip")
    other = labelled.drop_vars("leg").rename(leg="tip")
    opposite, lost = ("tip", [LEGS[MIRROR[LEGS.index(one)]] for one in shuffled]), ("start", ["L1", "R2", *"abcd"])
    five = other[:5].assign_coords(lost=("start", [*LEGS[:5]]))
    for given, those in ((tips.assign_coords(opposite=opposite, lost=lost), starts), (five, starts[:5])):
        assert np.array_equal(walk(given).x, walk(those).x)
    first = labelled.sel(leg=shuffled).rename(leg="k").T.drop_vars("k").assign_coords(leg=("k", shuffled))
    assert np.array_equal(walk(first).x, walk(starts).x)
    for index in (["R1", "L1", "R2", "R3", "L2", "L3"], [*LEGS, "L1", "none"]):  # which leg each lost first
        many = np.resize(starts, (len(index), 6))
        assert np.array_equal(walk(pd.DataFrame(many, index, [*LEGS])).x, walk(many).x)
        if len(index) > 6:
            assert np.array_equal(walk(pd.DataFrame(many, index)).x, walk(many).x)
    twice = other.assign_coords(one=("tip", [*LEGS]), other=opposite)
    sideways = labelled.rename(leg="tip").T
    for given in (
        *(other.assign_coords(lost=("start", names)) for names in ([*LEGS], ["L1", "L1", *LEGS[2:]])),
        *(twice, sideways.assign_coords(tip=[one.lower() for one in LEGS])),
        *(table.T.set_axis(names) for names in ([one.lower() for one in LEGS], ["L1", "L1", *LEGS[2:]])),
    ):
        with pytest.raises(hexmj.InputError, match=r"^starts (have|of) .*; expected "):
            walk(given)
    for kind in (list, deque):
        assert np.array_equal(walk(kind(labelled.sel(leg=shuffled))).x, walk(starts).x)
    assert np.array_equal(walk(Unlabelled(starts)).x, walk(starts).x)
    for rows in (table[shuffled], pd.DataFrame(starts)):
        assert np.array_equal(walk([*rows.itertuples(index=False)]).x, walk(starts).x)
    named = [*table[shuffled].itertuples(index=False)]
    assert np.array_equal(walk([type(row)(*map(np.array, row)) for row in named]).x, walk(starts).x)
    elsewhere = table.rename(columns=lambda leg: f"tip_{leg}")
    for given in (elsewhere, [*elsewhere.itertuples(index=False)]):
        with pytest.raises(hexmj.InputError, match=r"^starts of the legs tip_L1, .*; expected L1, L2, L3, R1, R2, R3$"):
            walk(given)
    for given in (sparse.coo_array(starts), ([[1.0], [1.0, 2.0]],)):
        with pytest.raises(hexmj.InputError, match=r"^starts = .*; expected numbers$"):
            walk(given)


def test_labelled_weights_stand_in_order():
    """Of their two axes of legs labels would say which is the destination's only by their order."""
    weights: Any = hexmj.LDVS.weights
    plain = weights.expand()
    labels, told = (
        {"leg": [*LEGS], "of": [*LEGS]},
        r"^p1 of the legs R3, .*; expected L1, L2, L3, R1, R2, R3, in order$",
    )
    tables: list[Any] = [pd.DataFrame(plain.p1, LEGS, LEGS), xr.DataArray(plain.p1, labels, ("leg", "of"))]
    for table in tables:
        assert np.array_equal(replace(plain, p1=table).p1, plain.p1)
        with pytest.raises(hexmj.InputError, match=told):
            replace(plain, p1=table[[*LEGS][::-1]] if table is tables[0] else table[:, ::-1])
    assert np.array_equal(replace(plain, p1=Unlabelled(plain.p1)).p1, plain.p1)
    numbered: Any = pd.DataFrame(plain.p1, [1, 2, 3, 4, 5, 6], [1, 2, 3, 4, 5, 6])
    assert np.array_equal(replace(plain, p1=numbered).p1, plain.p1)
    with pytest.raises(hexmj.InputError, match="p1 of the legs 4, 5, 6, 1, 2, 3; expected L1"):
        replace(plain, p1=numbered.iloc[[3, 4, 5, 0, 1, 2]])


class Unlabelled(np.ndarray):
    """Whose `columns` and `indexes` are something else."""

    def __new__(cls, values: np.ndarray) -> Any:
        return np.asarray(values).view(cls)

    def indexes(self) -> None: ...

    columns = None


class Table:
    """As polars has one: it knows its columns, and no index."""

    def __init__(self, table: Any, kind: Any = list) -> None:
        self.columns, self._values = kind(table.columns), table.to_numpy()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self._values, dtype=dtype)


def test_labelled_legs_of_a_posture_may_come_in_any_order():
    feet, stands = np.broadcast_to(FEET, (8, 6, 2)).copy(), np.random.default_rng(1).random((8, 6)) < 0.8
    margin, shuffled = hexmj.stability_margin(feet, stands), ["R1", "L2", "R3", "L1", "L3", "R2"]
    tips = xr.DataArray(feet, dims=("step", "leg", "xy"), coords={"leg": [*LEGS]})
    down = xr.DataArray(stands, dims=("step", "leg"), coords={"leg": [*LEGS]})
    table: Any = down.to_pandas()
    for one in (feet, tips.sel(leg=shuffled), tips.transpose("leg", "step", "xy"), tips.drop_vars("leg")):
        for other in (stands, down.sel(leg=shuffled), down.T, table[shuffled]):
            assert np.array_equal(hexmj.stability_margin(one, other), margin)
    polygon = hexmj.support_polygon(feet[0], stands[0])
    places: Any = tips[0].to_pandas()
    for one in (places, places.loc[shuffled]):
        assert np.array_equal(hexmj.support_polygon(one, table.iloc[0][shuffled]), polygon)
    for name in ("feet", "stance"):
        with pytest.raises(hexmj.InputError, match=f"^{name} = "):
            hexmj.stability_margin(**{"feet": feet, "stance": stands, name: down.to_dataset(name="down")})
    along = down.rename(leg="i").assign_coords(leg=("i", [*LEGS])).drop_vars("i")[:, ::-1]
    assert np.array_equal(hexmj.stability_margin(feet, along), margin)
    assert np.array_equal(hexmj.stability_margin(feet[:6], table[shuffled][:6].T), margin[:6])
    assert len(hexmj.support_polygon(places.loc[["R2", "L3", "L1"]], [1, 1, 1])) == 3
    assert np.array_equal(hexmj.stability_margin(places.set_axis(range(6, 12)), stands[0]), margin[0])
    with h5py.File("kept", "w", driver="core", backing_store=False) as kept:  # its datasets have axes without names
        kept["feet"] = feet
        assert np.array_equal(hexmj.stability_margin(kept["feet"], stands), margin)
    with pytest.raises(hexmj.InputError, match=r"^feet \(6,\) and stance"):
        hexmj.stability_margin(places.iloc[:, 0], stands[0])
    with pytest.raises(hexmj.InputError, match=r"^stance of the legs .*; expected L1, L2, L3, R1, R2, R3$"):
        hexmj.stability_margin(feet, down.assign_coords(leg=[*"abcdef"]))


def test_feet_and_stances_are_those_of_the_same_legs():
    feet = pd.DataFrame(np.arange(8.0).reshape(4, 2), index=["R1", "L1", "L2", "L3"])
    with pytest.raises(
        hexmj.InputError, match="feet of L1, L2, L3, R1, stance of L1, L2, R1, R2; expected those of the"
    ):
        hexmj.support_polygon(feet, pd.Series([True] * 4, index=["L1", "L2", "R1", "R2"]))
    assert len(hexmj.support_polygon(feet, pd.Series([True, True, False, False], index=["L1", "R1", "L2", "L3"]))) == 2


def test_labelled_parameters_stand_in_order():
    """pandas sorts columns by their names."""
    own: Any = hexmj.LDVS.weights
    every = general(own).to_vector()
    assert hexmj.Symmetric.from_vector([*xr.DataArray(own.to_vector())]) == own
    ordered = pd.Series(asdict(own))
    assert hexmj.Symmetric.from_vector(ordered) == own
    forms = {name: hexmj.NetworkForm(name) for name in FORMS}
    labelled = pd.Series(every, forms["general"].names)
    assert np.array_equal(hexmj.Weights.from_vector(labelled).to_vector(), every)
    sample = Sample(hexmj.Problem(forms["ldvs"], 0.3, 0.3, observation_time=20.0), 5, 0)
    table = ordered.to_frame().T
    wrong_order: Any = table.sort_index(axis="columns")
    tables: list[Any] = [table, Table(table)]
    for one in tables:
        assert np.array_equal(sample.costs(one), sample.costs(own.to_vector()[None]))
    square: Any = pd.concat([table] * 10)
    candidates: Any = xr.DataArray(square.values, {"parameter": [*ordered.index]}, ("candidate", "parameter"))
    for one in (square, candidates, [*square.itertuples(index=False)]):
        assert len({*sample.costs(one)}) == 1  # pyright: ignore
    fields = hexmj.FieldsForm(hexmj.load_controller("righetti"))
    usual: Any = xr.DataArray(fields.begin, {"parameter": [*fields.names]})
    assert fields.controller(usual) == fields.usual
    for wrong in (
        lambda: hexmj.Symmetric.from_vector(ordered.sort_index()),
        lambda: hexmj.Weights.from_vector(labelled.sort_index(ascending=False)),
        lambda: forms["ldvs"].controller(ordered[::-1]),
        lambda: forms["hws"].controller(ordered),
        lambda: fields.controller(usual[::-1]),
        lambda: sample.costs(wrong_order),
        lambda: sample.costs(square.T),
        lambda: sample.costs([ordered[::-1], ordered]),  # pyright: ignore
        lambda: sample.costs(deque([ordered[::-1]])),  # pyright: ignore
        lambda: sample.costs([*wrong_order.itertuples(index=False)]),  # pyright: ignore
        lambda: sample.costs([*table.itertuples()]),  # pyright: ignore
        lambda: hexmj.Symmetric.from_vector(pd.Series(own.to_vector())[::-1]),
        lambda: sample.costs(Table(wrong_order)),  # pyright: ignore
        lambda: sample.costs(Table(wrong_order, pd.Index)),  # pyright: ignore
    ):
        with pytest.raises(hexmj.InputError, match=r"in this order$"):
            wrong()


def test_a_vector_has_a_number_for_each_parameter():
    forms = *map(hexmj.NetworkForm, FORMS), hexmj.FieldsForm(hexmj.load_controller("righetti"))
    for form in forms:
        with pytest.raises(hexmj.InputError, match=rf"shape \(3,\); expected {len(form.names)}: "):
            form.controller(np.zeros(3))
