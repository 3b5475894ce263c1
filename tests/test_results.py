"""Results are the same after they were saved and loaded, and so is the figure that is drawn of them."""

import io
import os
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hexmj.storage import netcdf
from matplotlib.text import Text
from PIL import Image
from xarray.backends.locks import HDF5_LOCK

import hexmj
from hexmj.errors import InputError
from hexmj.plotting import FIGURES
from hexmj.search.stages import search
from hexmj.sweep import Study, run_study
from tiers import few_of


def test_data_are_kept_and_read_though_xarray_s_lock_is_held() -> None:
    """As it stays in a process that is forked while another thread of its parent has it."""
    data = xr.Dataset({"a": ("x", np.arange(3.0))}, coords={"x": ["für", "ω", "a"]})
    with ThreadPoolExecutor(1) as aside, HDF5_LOCK:
        made = aside.submit(lambda: netcdf.decode(netcdf.encode(data), "")).result(timeout=20)
    assert made.identical(data)


ALPHA = "ß: 1 $"
"""A name that JSON escapes, and that figures would set as a formula."""


def pixels(result: xr.Dataset, which: str | None = None) -> bytes:
    """The figure of a result."""
    drawn = io.BytesIO()
    hexmj.plot(result, which).savefig(drawn, format="rgba", dpi=50)
    return drawn.getvalue()


def flss() -> xr.Dataset:
    return hexmj.flss(hexmj.SensoryFeedback(hexmj.LDVS), [0.3, 0.5], n_starts=40, seed=2**70)


def compared() -> xr.Dataset:
    conditions = hexmj.Conditions(vp=200.0, ground="step", friction=0.5)
    slow = hexmj.Acceleration(rate=0.02)
    models = {ALPHA: hexmj.LDVS, "null": hexmj.load_controller("graham")}
    how: Any = {"n_starts": 3, "observation_time": 20.0, "conditions": conditions, "acceleration": slow}
    return hexmj.compare(models, [0.3, 0.5], **how)


def fallen() -> xr.Dataset:
    return hexmj.physical_flss(hexmj.LDVS, [0.5], n_starts=2, observation_time=10.0)


def recorded() -> xr.Dataset:
    return hexmj.record(hexmj.physical_walk(hexmj.draw_starts(1, 0), hexmj.LDVS, 0.5, 10.0), 0, ALPHA)


def study(name: str) -> xr.Dataset:
    from hexmj.studies.variants.study import Variants

    from hexmj.studies.ablation import Ablation, switched
    from hexmj.studies.biology import Biology
    from hexmj.studies.disturbance import DisturbedWalks
    from hexmj.studies.entrants import entrants
    from hexmj.studies.league import League
    from hexmj.studies.stability_map import StabilityMap
    from hexmj.studies.static_limit import StaticLimit
    from hexmj.studies.terrain import Terrain

    conditions = hexmj.Conditions(vp=200.0)
    small: dict[str, Callable[[], Study]] = {
        "map": lambda: StabilityMap(hexmj.LDVS, "vp", [80.0, 320.0], [0.5], n_starts=2, observation_time=10.0),
        "converge": lambda: StaticLimit(hexmj.LDVS, vps=[320.0], n_starts=2, observation_time=10.0),
        "terrain": lambda: Terrain(hexmj.LDVS, [0.6], ["step"], [3.0], grasps=[0.0], n_starts=2),
        "disturb": lambda: DisturbedWalks(hexmj.LDVS, [0.6], ["halt"], n_starts=2, observation_time=20.0),
        "variants": lambda: Variants({"ldvs": [hexmj.LDVS]}, [0.5], n_starts=2, observation_time=5.0, conditions=conditions),
        "biology": lambda: Biology(hexmj.LDVS, 4, n_starts=2),
        "league": lambda: League(entrants(("ldvs",)), (0.5,), n_starts=5, n_physical=2, n_tried=1, observation_time=20.0),
        "ablate": lambda: Ablation({"ldvs": switched("ldvs")}, [0.5], n_starts=5, n_physical=2, periods=12),
    }
    return run_study(small[name]())


def searched() -> xr.Dataset:
    problem = hexmj.Problem(hexmj.NetworkForm("hws"), 0.4, 0.4, 10.0)
    return search(problem, hexmj.Effort(starts=3, budget=10, refine_starts=3, refine_budget=2)).history


MADE: dict[str, Callable[[], xr.Dataset]] = {
    "flss": flss,
    "compare": compared,
    "physical": fallen,
    "recording": recorded,
    "search": searched,
}
STUDIES = [name for name in FIGURES if name not in MADE and name != "model_variants"]  # which takes minutes


def check_it_stays_the_same(result: xr.Dataset, folder: Path) -> None:
    """Saved in any way, read in any way."""
    ours, plain = hexmj.save(result, folder / "ours.nc"), folder / "plain.nc"
    result.to_netcdf(plain)
    with pytest.raises(InputError, match="no result that hexmj wrote"):
        hexmj.load(plain)
    with xr.open_dataset(ours, decode_times=False) as opened:
        for read in (hexmj.load(ours), xr.load_dataset(plain, decode_times=False), opened.load()):
            assert read.identical(result)
            assert hexmj.settings(read) == hexmj.settings(result)
            for which in FIGURES["recording" if "planned_stance" in read else read.attrs["study"]]:
                assert pixels(read, which) == pixels(result, which)


def lone(figure: Any) -> list[str]:
    """Lines through a single point that have no mark, and so are not seen."""
    lines = [line for axes in figure.axes for line in axes.get_lines() if len(line.get_xdata()) == 1]
    return [line.get_label() for line in lines if line.get_marker() in ("None", "", " ", None)]


def test_what_is_drawn_at_one_velocity_is_seen():
    recording = recorded()
    for result in (*(MADE[name]().isel(velocity=[0]) for name in ("flss", "compare")), recording.isel(step=slice(1))):
        figure = hexmj.plot(result)
        assert lone(figure) == [] and any(axes.get_lines() for axes in figure.axes)
    with pytest.raises(InputError, match=r"the recording .* holds no steps; expected at least one"):
        hexmj.plot(recording.isel(step=slice(0)))


@pytest.mark.parametrize(
    "part", [[0, 1, 2, 4, 6], [0, 1, 5, 6], slice(None, None, -1), [0, 0]], ids=["thinned", "cut", "back", "twice"]
)
def test_a_recordings_steps_are_drawn_in_even_order_only(part):
    with pytest.raises(InputError, match=r"has steps of .*; expected one step after the other, all of one length"):
        hexmj.plot(recorded().isel(step=part))
    hexmj.plot(recorded().isel(step=slice(None, None, 5)))


def test_a_recordings_legs_stand_in_their_order_however_they_are_sorted():
    recording = recorded()
    assert pixels(recording.isel(leg=slice(None, None, -1)), "walk") == pixels(recording, "walk")
    with pytest.raises(InputError, match=r"cannot be drawn of this part of a result, .*leg 3"):
        hexmj.plot(recording.isel(leg=slice(3)))


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(MADE, "flss", "physical"))
def test_a_result_stays_what_it_is(name: str, tmp_path: Path):
    check_it_stays_the_same(MADE[name](), tmp_path)


@pytest.mark.thorough
@pytest.mark.parametrize("name", STUDIES)
def test_a_study_stays_what_it_is(name: str, tmp_path: Path):
    check_it_stays_the_same(study(name), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", few_of(["terrain", "league"], "terrain"))
def test_a_part_of_a_result_is_drawn_or_refused_in_a_sentence(name: str):
    result, refused = study(name), 0
    for axis in result.dims:
        try:
            hexmj.plot(result.isel({axis: 0}))
        except InputError:
            refused += 1
    assert refused


def test_one_velocity_is_a_list_of_one():
    alone, listed = (hexmj.flss(hexmj.LDVS, v, n_starts=5) for v in (0.3, [0.3]))
    assert alone.identical(listed)
    alone, listed = (hexmj.compare(hexmj.LDVS, v, n_starts=2, observation_time=5.0) for v in (0.3, [0.3]))
    assert alone.identical(listed)


def test_settings_are_told_as_they_were_given():
    told = hexmj.settings(compared())
    assert told["study"] == "compare"
    assert [*told["controllers"]] == [ALPHA, "null"]
    assert told["conditions"] == hexmj.Conditions(vp=200.0, ground="step", friction=0.5).settings()
    assert told["acceleration"] == {"rate": 0.02, "start": 0.1}
    assert (told["observation_time"], told["starts"], told["seed"]) == (20.0, 3, 0)
    assert hexmj.settings(flss())["seed"] == 2**70
    assert hexmj.settings(flss())["acceleration"] is None


@pytest.mark.thorough
def test_the_title_tells_what_was_chosen():
    title = hexmj.plot(compared()).get_suptitle().replace("\N{NO-BREAK SPACE}", " ")
    for words in (
        "3 starts",
        "seed 0",
        "observation time of 20 time units",
        "= 200 mm/s",
        "friction 0.5",
        "ground: step",
        "a = 0.02",
    ):
        assert words in title
    assert "height" not in title, "what is as usual is not told"
    assert "ldvs, reading the legs" in hexmj.plot(flss()).get_suptitle()
    walknet = hexmj.flss(hexmj.load_controller("walknet"), [0.5], n_starts=5)
    assert hexmj.plot(walknet).get_suptitle().count("model_variant") == 0, "its own reading is another thing"
    lasting = hexmj.flss(hexmj.load_controller("lasting"), [0.5], n_starts=5)
    assert "lasting (reading lasting)" in hexmj.plot(lasting).get_suptitle()


def test_all_measures_are_seen_of_the_slowest_and_the_fastest_walks():
    """Beside each other, half of them at a lower V than was walked."""
    ends = hexmj.compare(hexmj.LDVS, [0.0, 0.999], n_starts=2, observation_time=1.0)
    (axes,) = hexmj.plot(ends).axes
    drawn = np.concatenate([line.get_xdata() for line in axes.get_lines()])
    assert len(drawn) and axes.get_xlim()[0] < drawn.min() < 0.0 and 1.0 < drawn.max() < axes.get_xlim()[1]


def test_a_title_fits_into_its_figure():
    """However small that is."""
    figure = hexmj.plot(compared())
    figure.set_size_inches(3.0, 3.0)
    figure.draw_without_rendering()
    (title,) = (one for one in figure.texts if one.get_text() == figure.get_suptitle())
    box = title.get_window_extent()
    assert 0.0 <= box.x0 <= box.x1 <= figure.bbox.width


def test_what_is_written_again_stays_as_private(tmp_path: Path):
    path = hexmj.save(xr.Dataset({"one": 1.0}), tmp_path / "kept.nc")
    for mode in (0o600, 0o664):
        path.chmod(mode)
        hexmj.save(xr.Dataset({"one": 2.0}), path)
        assert path.stat().st_mode & 0o777 == mode


def test_what_may_only_be_read_is_not_replaced(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Root may write everything."""
    monkeypatch.setattr("os.access", lambda path, mode: bool(os.stat(path).st_mode & 0o222))
    words = ("flss", "--velocities", "0.5", "--starts", "3", "--observation time", "start", "--out", tmp_path)
    assert run(*words)[0] == 0
    (kept := tmp_path / "flss.nc").chmod(0o444)
    before = kept.read_bytes()
    told = r"flss\.nc may only be read; expected a file that may be written"
    with pytest.raises(InputError, match=told):
        hexmj.save(xr.Dataset({"one": 2.0}), kept)
    code, _, error = run(*words, "--seed", "1")
    assert code == 2 and re.search(told, error)
    assert kept.read_bytes() == before


def test_a_notebook_is_shown_a_figure():
    shown = Image.open(io.BytesIO(hexmj.plot(flss())._repr_png_()))
    assert shown.format == "PNG"
    assert len(shown.convert("RGB").getcolors(1 << 20) or ()) > 20


def test_what_belongs_to_no_figure_is_refused_in_a_sentence(tmp_path: Path):
    wrong: Any = 3
    with pytest.raises(InputError, match="result is of the type int; expected a Dataset"):
        hexmj.plot(wrong)
    with pytest.raises(InputError, match="result = 3; expected a Dataset"):
        hexmj.save(wrong, tmp_path / "a.nc")
    with pytest.raises(InputError, match=r"a dataset of x; expected a result, .* of flss, compare, map"):
        hexmj.plot(xr.Dataset({"x": 1.0}))
    with pytest.raises(InputError, match="which = 'fate'; valid names: flss"):
        hexmj.plot(flss(), "fate")
    with pytest.raises(InputError, match=r"which = \['flss'\]; expected a text"):
        hexmj.plot(flss(), ["flss"])  # pyright: ignore[reportArgumentType]
    (tmp_path / "text.nc").write_text("no NetCDF")
    with pytest.raises(InputError, match=r"text\.nc is damaged, or no result"):
        hexmj.load(tmp_path / "text.nc")
    saved = hexmj.save(flss(), tmp_path / "cut.nc")
    saved.write_bytes(saved.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"cut\.nc is damaged"):
        hexmj.load(saved)


def small(**attributes: Any) -> xr.Dataset:
    """A variable with these attributes, beside a coordinate."""
    return xr.Dataset({"x": ("i", np.array([-1, 2], dtype=np.int8), attributes)}, {"c": ("i", [1.0, 2.0])})


@pytest.mark.parametrize(
    "value", ["", "ß\n", 1, -(2**63), 1.5, np.nan, np.int8(3), [1, 2], (1.5, 2), np.arange(3), ["a", "b"], []]
)
def test_what_netcdf_can_hold_comes_back(value: Any, tmp_path: Path):
    for data in (small(told=value), small().assign_attrs(told=value)):
        read = hexmj.load(hexmj.save(data, tmp_path / "a.nc"))
        assert read.identical(data)
        np.testing.assert_array_equal({**read.attrs, **read.x.attrs}["told"], value)


@pytest.mark.parametrize(
    "value",
    [
        *(True, np.True_, [True, False], None, {"a": 1}, {1}, b"a", "a\0", "\ud800", np.str_("a"), 2**70, object()),
        *([1], ["a"], [1, "a"], [None], ["a\0", "b"], [[1], [2, 3]], np.eye(2)),
        *(datetime(2000, 1, 1), np.datetime64("2000"), np.timedelta64(1, "s")),
    ],
)
def test_an_attribute_that_would_not_come_back_is_named(value: Any, tmp_path: Path):
    for data, of in ((small(told=value), "x"), (small().assign_attrs(told=value), "the dataset")):
        with pytest.raises(
            InputError, match=f"^NetCDF cannot hold this: {of} has the attribute told = .*; expected a text"
        ):
            hexmj.save(data, tmp_path / "a.nc")
    assert not [*tmp_path.iterdir()]


def test_orders_to_readers_of_netcdf_are_no_attributes(tmp_path: Path):
    orders = {"_Unsigned": "true", "dtype": "bool", "coordinates": "c", "_Encoding": "utf-8", "scale_factor": 2.0}
    for name, value in orders.items():
        with pytest.raises(
            InputError, match=f"^NetCDF would be read otherwise: x has the attribute {name}; expected none"
        ):
            hexmj.save(small(**{name: value}), tmp_path / "a.nc")
    with pytest.raises(InputError, match="the dataset has the attribute coordinates; expected none"):
        hexmj.save(small().assign_attrs(coordinates="c"), tmp_path / "a.nc")
    with pytest.raises(InputError, match="cannot write attribute with reserved name 'CLASS'"):
        hexmj.save(small(CLASS="c"), tmp_path / "a.nc")
    with pytest.raises(InputError, match=r"^[ -~]+$"):
        hexmj.save(small(told=xr.DataArray(1)), tmp_path / "a.nc")
    for spaced in ("my c", "my\u2009c"):
        with pytest.raises(InputError, match=r"the coordinate 'my.* has a space in its name; expected none"):
            hexmj.save(small().rename(c=spaced), tmp_path / "a.nc")


@pytest.mark.parametrize("old", ["x", "c", "i"])
def test_a_name_that_would_not_come_back_is_refused(old: str, tmp_path: Path):
    for name in ("a\0b", "\ud800", 3):
        with pytest.raises(
            InputError, match=r"^NetCDF cannot hold this: the name [ -~]+; expected a text without NUL$"
        ):
            hexmj.save(small().rename({old: name}), tmp_path / "a.nc")


@pytest.mark.slow
@pytest.mark.parametrize("form", few_of(["svg", "png", "pdf"], "svg"))
def test_a_command_draws_what_can_be_drawn_again(form: str, tmp_path: Path):
    words = ["compare", "--velocities", "0.5", "--starts", "2", "--observation time", "10", "--no-video", "--format", form]
    words += ["--out", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "hexmj", *words], check=True, capture_output=True)
    drawn = tmp_path / f"comparison.{form}"
    assert drawn.read_bytes()[:5] == {"png": b"\x89PNG\r", "pdf": b"%PDF-", "svg": b"<?xml"}[form]
    if form == "png":
        hexmj.plot(hexmj.load(tmp_path / "comparison.nc")).savefig(tmp_path / "again.png", dpi=150)
        assert (tmp_path / "again.png").read_bytes() == drawn.read_bytes()


def test_a_damaged_result_is_no_result(tmp_path):
    path = hexmj.save(hexmj.flss(hexmj.LDVS, [0.3, 0.5], n_starts=5, observation_time="start"), tmp_path / "flss.nc")
    whole = path.read_bytes()
    for wrong in (whole[:900] + bytes([whole[900] ^ 1]) + whole[901:], whole[:-1], whole + b" "):
        path.write_bytes(wrong)
        with pytest.raises(InputError, match="is damaged"):
            hexmj.load(path)


@pytest.mark.parametrize("name", ["walknet", "walknet-reacog", "walknet-load", "walknet-without-2"])
def test_a_figure_of_walknet_whose_reading_is_not_the_networks(name: str):
    result = hexmj.flss(hexmj.load_controller(name), [0.3], n_starts=3, observation_time="start")
    told = " ".join(text.get_text() for text in hexmj.plot(result).findobj(Text))
    assert name in told and "model_variant" not in told


def test_what_has_lost_its_velocities_gets_a_sentence():
    result = hexmj.flss(hexmj.LDVS, [0.3, 0.5], n_starts=5, observation_time="start")
    hexmj.plot(result.isel(velocity=[0]))
    for wrong in (0, []):
        with pytest.raises(InputError, match="without the axis velocity"):
            hexmj.plot(result.isel(velocity=wrong))
    both = hexmj.compare({"hws": hexmj.HWS, "ldvs": hexmj.LDVS}, [0.3], n_starts=1, observation_time=5.0)
    with pytest.raises(InputError, match=r"; of one controller without an axis\); expected the result as it .*isel\("):
        hexmj.plot(both.sel(controller="hws"))
    hexmj.plot(both.assign_coords(run=3))
    with pytest.raises(InputError, match="without the values of its axis velocity"):
        hexmj.plot(result.drop_vars("velocity"))
    with pytest.raises(InputError, match=r"cannot be drawn of this part of a result, V 2.* no attribute 'velocity'"):
        hexmj.plot(result.rename(velocity="V"))
    with pytest.raises(InputError, match="result = None"):
        hexmj.settings(None)  # pyright: ignore[reportArgumentType]
