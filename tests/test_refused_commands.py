"""Options that make no sense get one sentence and exit code 2, and results that lie there stay as they are."""

import os

import pytest

import hexmj

NONSENSE = [
    (["reproduce", "--only", "nothing"], "claim 'nothing'; valid keys: "),
    (["reproduce", "--quick", "--seed", "-1"], "seed = -1"),
    (["reproduce", "--only", "p2", "--seed", "-1"], "seed = -1"),
    (["model_variants", "--only", "lasting", "lasting"], "--only = ['lasting', 'lasting']; expected at least one, and none"),
    (["reproduce", "--only", "p2", "--beside"], "--beside without names; expected at least one"),
    (["search", "--velocity", "1"], "expected 0 <= low <= high < 1"),
    (["search", "--velocities", "0.5", "0.1"], "velocity range 0.5 to 0.1; expected 0 <= low <= high < 1"),
    (["search", "--velocities", "0.1", "1.5"], "expected 0 <= low <= high < 1"),
    (["search", "--velocities", "0", "0.5"], "velocity = 0 has no period"),
    (["walk", "--velocity", "-0.1"], "velocity = -0.1 has no period"),
    (["search", "--velocity", "0.1", "--velocities", "0.1", "0.5"], "expected one velocity or one range"),
    (["search", "--begin", "ldvs", "--form", "hws"], "ldvs has weights that the form hws lacks; expected a set of it"),
    (
        ["search", "--begin", "own-0.1", "--form", "ldvs"],
        "own-0.1 has weights that the form ldvs lacks; expected a set of it; forms that have them: general",
    ),
    (["flss", "--physical", "--ground-height", "5"], "--ground-height with --ground flat; expected it with a ground"),
    (
        ["flss", "--physical", "--ground", "gap", "--ground-height", "5"],
        "--ground-height with --ground gap; expected",
    ),
    (["walk", "--physical", "--ground", "step", "--ground-seed", "4"], "--ground-seed with --ground step; expected it"),
    (
        ["flss", "--velocities", "0.3", "--velocities", "0.5"],
        "--velocities was given twice; expected",
    ),
    (["flss", "--pep-min", "-15", "--pep_min", "-12"], "--pep-min was given twice; expected every option once"),
    (["flss", "--out", ""], "'' was given; expected options, each with its values, none of them empty"),
    (["terrain", "--processes", "1" + 23 * "0"], "expected at least 1 and at most 1000"),
    (["reproduce", "--only"], "--only without keys; expected at least one"),
    (["league", "--controllers", "--starts", "2"], "controllers = []; expected at least one, and none of them twice"),
    (["league", "--velocities", "--starts", "2"], "velocities = (); expected a list of numbers, at least one"),
    (
        ["walk", "--observation time", "1000001"],
        "duration = 1000001; expected at least one step, 0.1, and at most 1e+06 time units",
    ),
    (["walk", "--physical", "--ground", "hurdle", "--ground-length", "1e-300"], "cannot be built: "),
    (["walk", "--physical", "--ground", "rough", "--ground-seed", "9" * 30], "expected a whole number of at least 0"),
    (["render", "--observation time", "1", "--fps", "1e-300"], "fps = 1e-300; expected 1 to 240"),
    (["search", "--begin=", "--velocity", "0.3"], "'--begin=' was given; expected options, each with its values, none"),
    (["walk", "--out="], "'--out=' was given; expected options, each with its values, none of them empty"),
    (["reproduce", "--only", "p2", "p2"], "--only = ['p2', 'p2']; expected at least one, and none of them twice"),
    (["flss", "--starts", "5", "--"], "'--' was given; expected options, each with its values, none of them empty"),
    (["flss", "--aep0", "1e308", "--pep0=-1e308", "--pep-min=-1e308"], "expected aep0, pep0 and pep_min between"),
    (["search", "--population", "0"], "expected a whole number of at least 2"),
    (["search", "--algorithm", "cmaes", "--population", "1"], "expected a whole number of at least 4"),
    (["map", "--values"], "--values without numbers; expected at least one, or no --values for the usual ones"),
    (["disturb", "--disturbances"], "no disturbance was given"),
    (["search", "--budget", "0"], "at least one generation, 10 evaluations"),
    (["search", "--refine-starts", "0"], "refine_starts = 0; expected"),
    (["search", "--verdict-starts", "0"], "verdict_starts = 0; expected"),
    (["search", "--verdict-seed", "0"], "expected another, for fresh starts"),
    (["search", "--verdict-seed", "-1"], "verdict_seed = -1; expected"),
    (
        ["search", "--acceleration", "0.01", "--observation time", "19"],
        "V = 0.3 is reached at 20 time units, the observation time ends at 19",
    ),
    (["search", "--domain", "nan"], "domain = nan; expected"),
    (["search", "--form", "lvds"], "forms of the 1998 network: hws, ldvs, mirrored, general"),
    (["search", "--form", "own"], "no field of the type float"),
    (["search", "--refine-starts", "9", "--refine-budget", "0"], "expected evaluations that walk them"),
    (["search", "--observation time", "long"], "valid names: walk, start"),
    (["search", "--over", "mean", "--pep0", "-16"], "pep_min = -15.0, pep0 = -16.0"),
    (["variants", "--models", "own-V", "--velocities", "0.15"], "own-V at V = 0.15: controller 'own-0.15' is neither"),
    (["variants", "--velocities"], "velocities = []; expected a list of numbers, at least one"),
    (["variants", "--friction", "0.5"], "--friction without --physical"),
    (["variants", "--physical", "--contact-gap", "0.01"], "--contact-gap = 0.01 with falls only"),
    (["flss", "--model", "lvds"], "hws, ldvs, uncoordinated"),
    (["flss", "--velocities", "1.2"], "0 <= V < 1"),
    (["search", "--threads", "0"], "threads = 0; expected a whole number of at least 1"),
    (["flss", "--threads", "0", "--processes", "2"], "threads = 0; expected a whole number of at least 1"),
    (["flss", "--velocities", "fast"], "Could not find valid parse for arguments: ['fast']"),
    (["flss", "--velocity", "0.1"], "Unrecognized options"),
    (["flss", "--observation time", "long"], "valid names: walk, start"),
    (["flss", "--starts", "0"], "at least 1"),
    (["flss", "--dt", "0"], "dt = 0.0; expected"),
    (["flss", "--geometry", "round"], "fig1"),
    (["flss", "--acceleration", "-1"], "above 0"),
    (["walk", "--start", "-1"], "at least 0"),
    (["walk", "--physical", "--step-height", "40"], "step_height = 40.0; expected above 0 and at most 14 mm"),
    (["walk", "--physical", "--vp", "nan"], "vp = nan; expected"),
    (["compare", "--models", "nowhere.toml"], "is no file; expected the path"),
    (["compare", "--models", "ldvs", "ldvs"], "none of them twice"),
    (["flss", "--observation time", "1e300"], "at most"),
    (["flss", "--starts", "100000000000000"], "at most 100000000"),
    (["flss", "--physical", "--contact-gap", "-1"], "contact_gap = -1.0; expected 0 to 1000 ms"),
    *(
        ([*words, "--contact-gap", "5"], "--contact-gap = 5 with falls only; expected it where a polygon is measured")
        for words in (["flss", "--physical"], ["terrain"], ["disturb"], ["search", "--physical"])
    ),
    (["flss", "--pep-min", "5"], "hexmj: pep_min = 5.0, pep0 = -10.0, aep0 = 10.0 mm; expected"),
    (["flss", "--model", "x" * 400], "neither one of hws, ldvs"),
    (["flss", "--out", "results/flss/manifest.json"], "is a file; expected a folder"),
    (["flss", "--out=~/flss"], "hexmj: --out ~/flss: expected the path of the folder for which ~ stands"),
    (["walk", "--out", "walk.PNG"], "walk.PNG is called like a file; expected a folder, which"),
    (["render", "--out", "film.mp4"], "film.mp4 is called like a file; expected a folder, which"),
    (["render", *(f"{n}.nc" for n in range(7))], "7 recordings were given; expected 1 to 6"),
    (["render", "a.nc", "--beside", "planned"], "--beside was given with recordings"),
    (["render", "--slow-motion", "1e12"], "expected 0.001 to 1000"),
    (["render", "--camera", "behind"], "following"),
    (["render", "--format", "avi"], "gif"),
    (["flss", "--format", "pdf"], "--format pdf without --out; expected it where a figure is written"),
    (["render", "--width", "321"], "even number"),
    (["render", "nowhere.nc"], "nowhere.nc"),
    (["render", "--beside", "ldvs"], "--beside = ldvs is the --model, too; expected another controller"),
    (["render", "--beside", "nobody"], "hws, ldvs, uncoordinated"),
    (["render", "a.nc", "--seed", "1"], "--seed was given with recordings"),
    (["flss", "--friction", "0.5"], "--friction without --physical; expected it only where"),
    (["flss", "--feedback"], "--feedback without --physical"),
    (["search", "--load", "1"], "--load without --physical"),
    (["walk", "--ground", "step"], "--ground without --physical"),
    (
        ["walk", "--initial-velocity", "0.2"],
        "--initial-velocity = 0.2 without --acceleration; expected it with that only",
    ),
    (["flss", "--physical", "--load", "-1"], "load = -1.0; expected 0 to 10"),
    (["flss", "--order", "x"], "valid names: printed, undelayed, sequential"),
    (["walk", "--physical", "--order", "printed", "--model", "nowhere.py:Tripod"], "nowhere.py is no file"),
    (["map", "--processes", "0"], "--processes = 0; expected at least 1"),
    (["check-controller", "nothing"], "nor module:object or file.py:object"),
    (["dance"], "compare, flss, walk, render, page, view, search"),
]


@pytest.mark.parametrize(
    ("words", "sentence"), NONSENSE, ids=lambda value: " ".join(value) if isinstance(value, list) else ""
)
def test_nonsense_gets_a_sentence_and_code_2_and_leaves_results_alone(run, tmp_path, monkeypatch, words, sentence):
    monkeypatch.chdir(tmp_path)
    results = [tmp_path / "results" / words[0] / name for name in ("manifest.json", "recording.nc", "gait.mp4")]
    for path in results:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("precious")
    code, out, error = run(*words)
    assert code == 2
    assert sentence in " ".join(error.replace("│", " ").split())
    assert out == ""
    assert {path: path.read_text() for path in tmp_path.rglob("*") if path.is_file()} == dict.fromkeys(
        results, "precious"
    )


def test_a_folder_that_is_a_file(run, tmp_path):
    (tmp_path / "taken").write_text("precious")
    code, _, error = run("walk", "--out", tmp_path / "taken")
    assert code == 2
    assert "expected a folder" in error
    assert (tmp_path / "taken").read_text() == "precious"


@pytest.mark.parametrize(("make", "what"), [(os.mkdir, "folder"), (os.mkfifo, "pipe or a device")])
def test_a_result_s_place_that_is_taken_by_no_file(run, tmp_path, make, what):
    make(tmp_path / "manifest.json")
    code, _, error = run("walk", "--out", tmp_path)
    assert code == 2
    assert f"manifest.json is a {what} there" in error
    assert [path.name for path in tmp_path.iterdir()] == ["manifest.json"]


def test_bad_input_makes_no_folder(run, tmp_path):
    assert run("walk", "--velocity", 2, "--out", tmp_path / "new")[0] == 2
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
def test_what_cannot_be_filmed_makes_no_folder(run, tmp_path):
    walked = hexmj.physical_walk(hexmj.draw_starts(1, 0), hexmj.LDVS, 0.5, 1.0)
    hexmj.save_recording(hexmj.record(walked).assign_attrs(body="beetle"), tmp_path / "beetle.nc")
    code, _, error = run("render", tmp_path / "beetle.nc", "--out", tmp_path / "new" / "films")
    assert code == 2
    assert "the recording is of the body 'beetle'" in error
    assert [path.name for path in tmp_path.iterdir()] == ["beetle.nc"]
