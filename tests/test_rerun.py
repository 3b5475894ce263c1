"""`hexmj rerun`: a result is made again from its manifest, and what is not equal to the last bit has its reasons."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr

from hexmj.cli.command_words import deciding, files
from hexmj.cli.rerun import _Repeated
from hexmj.paper.protocol import QUICK
from hexmj.storage import netcdf
from hexmj.storage.files import digest, sealed, write_whole
from hexmj.io import save
from hexmj.timing import Acceleration
from tiers import few_of

FLSS = ("flss", "--velocities", "0.5", "--starts", "40", "--observation time", "start")

COMMANDS = {
    "flss": FLSS,
    "walk": ("walk", "--physical", "--velocity", "0.5", "--observation time", "10"),
    "search": (
        *("search", "--form", "hws", "--starts", "20", "--observation time", "start", "--budget", "20"),
        *("--refine-starts", "20", "--refine-budget", "4", "--verdict-starts", "20"),
    ),
    "compare": ("compare", "--models", "ldvs", "--velocities", "0.5", "--starts", "3", "--observation time", "10", "--no-video"),
}

MINE = """
from dataclasses import dataclass
from hexmj.controllers import Step, stepwise

@dataclass(frozen=True)
class Drags:
    name: str = "drags"

    def begin(self, starts, velocity, stride, acceleration=None, threads=None):
        x = starts.copy()

        def step(v):
            x[:] = x + 1.0 * (stride.pep_min - x) * stride.dt
            return Step(x, x > -15.0)

        return stepwise(step, starts, velocity, stride, acceleration)
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Where results are copied from."""
    return tmp_path_factory.mktemp("made")


@pytest.fixture
def flss(run, made, tmp_path) -> Path:
    """A result of its own, which a test may change."""
    if not (made / "flss").exists():
        assert run(*FLSS, "--out", made / "flss")[0] == 0
    return Path(shutil.copytree(made / "flss", tmp_path / "flss"))


def edit(path: Path, **changed: object) -> None:
    told = json.loads(path.read_text())
    path.write_text(json.dumps(told | changed))


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_result_made_again_is_equal_to_the_last_bit(run, tmp_path, name):
    workers = ["--threads", 1, "--json"]
    assert run(*COMMANDS[name], *workers, "--out", tmp_path / "out")[0] == 0
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["command"] == list(COMMANDS[name])
    assert str(tmp_path) not in json.dumps(manifest)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    code, text, _ = run("rerun", tmp_path / "out", *(["--processes", 1] if name == "compare" else ["--threads", 2]))
    told = " ".join(text.split())
    assert code == 0, text
    assert "values are equal to the last bit" in told and "although" not in told
    assert all(file in text for file in manifest["files"])
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before


def test_the_paper_recomputed(run, tmp_path, monkeypatch):
    few = replace(QUICK, samples=1, sample=5, velocities=(0.1, 0.9), acceleration=Acceleration(rate=0.001))
    monkeypatch.setattr("hexmj.paper.protocol.QUICK", few)
    assert run("reproduce", "--quick", "--only", "ldvs-accelerated", "--out", tmp_path)[0] == 0
    code, text, _ = run("rerun", tmp_path, "--json")
    assert code == 0
    (result,) = json.loads(text)["results"]
    assert result["files"]["claims.md"] == "not compared"
    assert "claims.ours.walk.value" in {one["name"] for one in result["files"]["claims.json"]}


def test_a_number_that_was_changed_is_found_and_named(run, flss):
    data = xr.load_dataset(flss / "flss.nc")
    data.high.values[0] += 1e-9
    write_whole(flss / "flss.nc", sealed(netcdf.encode(data)))
    code, text, _ = run("rerun", flss)
    told = " ".join(text.split())
    assert code == 1
    assert "high 1 1 differ, by at most 1e-09" in told
    assert "low 1 equal" in told
    assert "1 of 28 values differ; what else differs, and may be why: changed since they were written (flss.nc)" in told
    code, text, _ = run("rerun", flss / "manifest.json", "--json")
    answer = json.loads(text)
    (result,) = answer["results"]
    (high,) = [one for one in result["files"]["flss.nc"] if one["differ"]]
    assert (code, answer["equal"], high["name"], high["values"]) == (1, False, "high", 1)
    assert high["most"] == pytest.approx(1e-9)
    assert result["files"]["flss.png"] == "not compared"
    assert result["differs"] == {"files": ["flss.nc"]}


def test_where_the_manifest_knows_no_reason_it_says_so(run, flss):
    data = xr.load_dataset(flss / "flss.nc")
    data.flss.values[:] = 2.0
    write_whole(flss / "flss.nc", sealed(netcdf.encode(data)))
    edit(flss / "manifest.json", files={"flss.nc": digest((flss / "flss.nc").read_bytes())})
    code, text, _ = run("rerun", flss)
    assert code == 1
    assert "nothing that the manifest knows of differs (files that your code reads it does" in " ".join(text.split())


def test_what_differs_is_named_even_where_all_numbers_are_equal(run, flss):
    path = flss / "manifest.json"
    manifest = json.loads(path.read_text())
    assert {"python", "hexmj", "numpy", "numba", "mujoco"} <= set(manifest["versions"])
    edit(
        path,
        versions=manifest["versions"] | {"numba": "0.1"},
        code={name: one for name, one in manifest["code"].items() if name != "hexmj.walks"},
        processor=[*manifest["processor"], "AVX1024"],
        settings=manifest["settings"] | {"seed": 7},
    )
    code, text, _ = run("rerun", flss)
    told = " ".join(text.split())
    assert code == 0
    numba = manifest["versions"]["numba"]
    assert f"although not all is as it was: versions (numba 0.1, now {numba}), code (hexmj.walks)" in told
    assert "processor (AVX1024 then, not now), settings (seed)" in told


@pytest.mark.slow
@pytest.mark.parametrize("toml", few_of(["fields.toml", "fields.conf"], "fields.toml"))
def test_a_controller_of_one_s_own_that_was_edited(run, tmp_path, monkeypatch, toml):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(MINE)
    Path(toml).write_text('controller = "mine.py:Drags"\n[fields]\nname = "other"\n')
    words = ["flss", "--model", toml, "--velocities", 0.5, "--starts", 20, "--observation time", 30, "--physical"]
    code, _, error = run(*words, "--out", "out")
    assert code == 0, error
    assert set(json.loads(Path("out/manifest.json").read_text())["own"]) == {"mine.py", toml}
    assert run("rerun", "out")[0] == 0
    Path("mine.py").write_text(MINE.replace("1.0 *", "0.5 *"))
    code, text, _ = run("rerun", "out")
    told = " ".join(text.split())
    assert code == 1
    assert "what else differs, and may be why: your files (mine.py)" in told
    Path("mine.py").unlink()
    code, _, error = run("rerun", "out")
    assert code == 2
    assert "mine.py, with which out/manifest.json was made, is no file here; expected to run where" in error


@pytest.mark.slow
def test_a_result_of_other_words_in_its_place_is_told(run, tmp_path):
    words = "compare", "--velocities", "0.5", "--observation time", "5", "--no-video", "--out", str(tmp_path / "kept"), "--starts"
    told = [run(*words, starts)[2] for starts in ("2", "3", "3")]
    assert "kept held what hexmj compare --velocities 0.5 --observation time 5 --no-video --starts 2 wrote; this has" in told[1]
    assert all("held what" not in one for one in (told[0], told[2]))


def test_a_folder_means_all_its_manifests(run, flss):
    shutil.copy(flss / "manifest.json", flss / "vp-manifest.json")
    code, text, _ = run("rerun", flss, "--json")
    assert code == 0
    assert [Path(one["manifest"]).name for one in json.loads(text)["results"]] == ["manifest.json", "vp-manifest.json"]


def test_a_film_beside_a_result_is_not_repeated(run, flss):
    shutil.copy(flss / "manifest.json", film := flss / "film.mp4-manifest.json")
    edit(film, files={"film.mp4": ""})
    code, text, _ = run("rerun", flss)
    assert code == 0
    assert "film.mp4-manifest.jsonnamesnofilewithnumbers,andwasnotrepeated" in "".join(text.split())


OLD = {"settings": {"seed": 0}, "versions": {"numpy": "2.4.6"}, "machine": "x86_64"}


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("{", "cannot be read as JSON"),
        ("[" * 100_000, "cannot be read as JSON"),
        ("\udcff", "is no text in UTF-8"),
        ("[1]", "is no manifest; expected one that a hexmj command wrote"),
        (json.dumps(OLD), "has format 1; expected 2: make the result anew with this version"),
        (json.dumps(OLD | {"format": 3}), "has format 3; expected 2"),
        ({"command": "flss"}, "command = 'flss'; expected list[str]"),
        ({"command": []}, "names no command"),
        ({"code": {"hexmj": 1}}, "code = {'hexmj': 1}; expected dict[str, str]"),
        ({"command": ["dance"]}, "this version cannot run hexmj dance"),
        ({"command": ["flss", "--help"]}, "this version cannot run hexmj flss --help"),
        ({"command": ["doctor"]}, "this version cannot run hexmj doctor"),
        ({"command": ["rerun", "."]}, "this version cannot run hexmj rerun ."),
        ({"files": {"flss.png": ""}}, "names no file with numbers"),
        ({"files": {"flss.nc": "", "more.nc": ""}}, "names more.nc, which is not beside it"),
    ],
)
def test_a_manifest_that_makes_no_sense_gets_a_sentence(run, flss, content, sentence):
    path = flss / "manifest.json"
    if isinstance(content, dict):
        edit(path, **content)
    else:
        path.write_bytes(content.encode(errors="surrogateescape"))
    code, out, error = run("rerun", flss)
    assert (code, out) == (2, "")
    assert sentence in error.splitlines()[-1]


def test_no_manifest_gets_a_sentence(run, tmp_path):
    assert "holds no manifest.json" in run("rerun", tmp_path)[2]
    assert "nowhere cannot be read: No such file" in run("rerun", tmp_path / "nowhere")[2]
    file = save(xr.Dataset(), tmp_path / "flss.nc")
    assert "flss.nc is no manifest; expected one, or a folder" in run("rerun", file)[2]


def test_a_result_that_cannot_be_read_gets_a_sentence_before_anything_is_repeated(run, flss, monkeypatch):
    monkeypatch.setattr("hexmj.cli.rerun.options_of", None)
    (flss / "flss.nc").write_text("nothing")
    code, _, error = run("rerun", flss)
    assert code == 2
    assert "flss.nc cannot be read as NetCDF" in error
    assert "; it was changed after it was written" in error


@pytest.mark.parametrize(
    ("before", "begins"),
    [
        ("from dataclasses", ""),
        ("    def begin", "    def __post_init__(self):\n        "),
        ("        x = starts.copy()", "        "),
    ],
)
def test_a_file_that_changes_the_folder_does_not_lead_results_astray(run, tmp_path, monkeypatch, before, begins):
    """As it is imported, as its controller is made, or as that begins a plan."""
    monkeypatch.chdir(tmp_path)
    Path("sub").mkdir()
    away = f"{begins}os.chdir(os.path.dirname(os.path.abspath(__file__)))\n"
    Path("sub/mine.py").write_text("import os\n" + MINE.replace(before, away + before, 1))
    words = ["flss", "--model", "sub/mine.py:Drags", "--velocities", 0.5, "--starts", 5, "--observation time", 10]
    assert run(*words, "--out", "out")[0] == 0
    assert set(json.loads(Path("out/manifest.json").read_text())["own"]) == {"sub/mine.py"}
    assert Path.cwd() == tmp_path
    assert run("rerun", "out")[0] == 0


@pytest.mark.slow
def test_a_file_that_was_edited_while_the_command_ran_counts_as_it_ran(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    edits = "from pathlib import Path\nPath('mine.py').write_text('')\n"
    for name, text in (("mine.py", MINE), ("edits.py", MINE.replace("def begin", "def begin", 1) + edits)):
        Path(name).write_text(text)
    told = digest(Path("mine.py").read_bytes())
    words = ["compare", "--models", "mine.py:Drags", "edits.py:Drags", "--no-video", "--velocities", 0.5, "--starts", 5]
    code, _, error = run(*words, "--observation time", 10, "--out", "out")
    manifest = json.loads(Path("out/manifest.json").read_text())
    assert code == 0, error
    assert manifest["own"]["mine.py"] == told


def test_where_nothing_could_be_compared_nothing_is_equal():
    nothing = _Repeated(Path("manifest.json"), ["flss"], {"flss.nc": "not compared, not there then"}, {})
    assert not nothing.equal
    assert "equal" not in nothing.sentence


def test_words_that_decide_nothing_are_left_out(tmp_path, monkeypatch):
    words = ["compare", "--out", "there", "--models", "a", "--json", "--threads=2", "--velocities", "0.1", "0.2"]
    words += ["--processes", "3", "--out=x"]
    assert deciding(words) == ["compare", "--models", "a", "--velocities", "0.1", "0.2"]
    assert deciding(["walk", "--out"]) == ["walk"]
    assert deciding(["walk", "--range_of", "20", "--range-of=20", "--range_of=20"]) == ["walk"]
    monkeypatch.chdir(tmp_path)
    for name in ("mine.py", "weights.toml", "a.nc"):
        Path(name).write_text("")
    assert files(["render", "a.nc", "--model=mine.py:X", "--beside", "weights.toml"]) == [
        *map(Path, ("a.nc", "mine.py", "weights.toml"))
    ]
    Path("weights.toml").write_text("controller = 'mine.py:X-without-1'")
    assert files(["flss", "--model", "weights.toml-without-2"]) == [*map(Path, ("weights.toml", "mine.py"))]


def test_files_that_are_named_like_a_window_a_number_or_a_controller_do_not_count(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("walk", "start", "0.3", "ldvs", "step", "mine"):
        Path(name).write_text("")
    words = ["walk", "--observation time", "start", "--velocity=0.3", "--model", "ldvs", "--ground", "step", "--beside", "mine"]
    assert files(words) == [Path("mine")]
