"""Run every feature at a small size and compare the results with the reference in `features.json`.

`python tests/features.py` runs all features, `python tests/features.py render league` those whose names begin with one
of the words. `--record` writes the results to the reference. Floating-point numbers agree to 0.01 %, all else exactly.
If a key gets a new name, add it to `RENAMED`; if a key is added or removed, add it to `IGNORED` or record again.
"""

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from inspect import ismodule
from io import StringIO
from pathlib import Path
from runpy import run_path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch
from urllib.request import urlopen
from zlib import crc32

os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np

import hexmj

sys.path.insert(0, "")  # the working directory has the modules of a user, but not the package

REFERENCE = Path(__file__).with_suffix(".json")
EXAMPLES = Path(__file__).parents[1] / "examples"

RENAMED: dict[str, str] = {
    "window": "observation_time",
    "reading": "model_variant",
    "ReadsLegs": "SensoryFeedback",
    "n_physical": "physical_starts",
    "n_tried": "trial_starts",
    "tried_at": "trial_velocity",
}  # key, file name or text in the reference -> its new name
# Keys and file names that are not compared; see `walk settings`.
IGNORED = {"settings", "variants.py", "model_variants.py"}
TOLERANCE = {"rel_tol": 1e-4, "abs_tol": 1e-6}  # of floating-point numbers
LONGEST = 12  # longer arrays of numbers are stored as a summary
COARSE = hexmj.Stride(dt=0.5)

# Files of a user, among them the examples.
USER_FILES = {file.name: file.read_text() for file in EXAMPLES.glob("*.*")} | {
    "mine.toml": "duration = 40\ncommand = 0.2\n[terrain]\nground = 'stairs'\n[[events]]\nkind = 'halt'\ntime = 10\n",
    "weights.toml": "order = 'sequential'\n[symmetric]\np1_i = 12\np1_c = 6\np31_i = -9\np32_i = 6\np4_i = 1\n",
    "fields.toml": "controller = 'tripod.py:Tripod'\n[fields]\npull = 0.5\n",
    "broken.py": "from tripod import Tripod\nclass Broken(Tripod):\n    begin = lambda *_: None\n",
    "feature-1.0.dist-info/entry_points.txt": "[hexmj.controllers]\nentry-tripod = tripod:Tripod\n",
}


def run_command(line: str, terminal: bool = False) -> tuple[int, str, str]:
    """Run `hexmj` in this process; return the exit code, standard output and standard error."""
    from hexmj.cli.main import main

    out, error, code = StringIO(), StringIO(), 0
    words = patch.object(sys, "argv", ["hexmj", *shlex.split(line)])
    with words, redirect_stdout(out), redirect_stderr(error), patch.object(error, "isatty", lambda: terminal):
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
    return code, out.getvalue(), error.getvalue()


def answer(line: str, code: int = 0) -> dict[str, Any]:
    """Run a command; return the printed JSON object. The exit code must be `code`, and all files must exist."""
    out = "" if line.startswith(("check-controller", "doctor", "rerun")) else f"--out out-{crc32(line.encode()):x}"
    found, text, error = run_command(f"{line} --json {out}")
    if found != code:
        raise AssertionError(f"exit code {found}, expected {code}: {error.strip()[-300:]}")
    result = json.loads(text)
    if empty := [name for name in result.get("files", ()) if not Path(name).stat().st_size]:
        raise AssertionError(f"empty files: {empty}")
    return result


def text(line: str) -> Any:
    """Run a command without --json; return the decimal numbers that it prints."""
    code, out, error = run_command(line)
    numbers = [float(word) for word in re.findall(r"-?\d+\.\d\d+", out)]
    return {"code": code, "numbers": numbers, "output": bool(out), "error": "hexmj: " in error}


def same_with(options: str, line: str) -> Any:
    """Run a command with and without options on which no result depends."""
    without, with_options = normal(answer(line)), normal(answer(f"{line} {options}"))
    return without | {"equal": without == with_options}


def resumed(line: str) -> Any:
    """Run a command twice in one folder and once by `hexmj rerun`; the second run reuses the cells of the first one."""
    once = answer(line)
    folder = Path(once["files"][0]).parent
    cells = {path: path.stat().st_mtime_ns for path in folder.glob("*/**/*") if path.is_file()}
    equal = normal(once) == normal(answer(line)) and answer(f"rerun {folder}")["equal"]
    reused = bool(cells) and all(path.stat().st_mtime_ns == then for path, then in cells.items())
    return once | {"equal": equal, "reused": reused}


def start_process(line: str) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONUNBUFFERED": "1", "PYTHONPATH": str(Path(hexmj.__file__).parents[1])}
    words = [sys.executable, "-m", "hexmj", *shlex.split(line)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)


def process(line: str) -> Any:
    started = start_process(line)
    out = started.communicate(timeout=60)[0]
    result = json.loads(out) if "--json" in line else {name: name in out for name in ("hexmj", "walk", "rerun")}
    return result | {"code": started.returncode}


def view(words: str) -> Any:
    """Serve a view in a process of its own, load its page, and stop it with Ctrl-C."""
    recordings()
    with start_process(f"view --browser --port 0 {words}") as served:
        try:
            address = next(found[0] for line in served.stdout or () if (found := re.search(r"http://\S+:\d+", line)))
            with urlopen(address, timeout=20) as reply:
                result = {"status": reply.status, "html": b"<html" in reply.read().lower()}
            served.send_signal(signal.SIGINT)
            return result | {"code": served.wait(20)}
        finally:
            served.kill()


def shown(line: str) -> Any:
    """Make a film or a page; return the answer with what the file contains."""
    import imageio_ffmpeg

    recordings()
    result = answer(line)
    (file,) = (name for name in result["files"] if name.endswith((".mp4", ".gif", ".html")))
    if file.endswith(".html"):
        return result | {"pages": Path(file).read_text().count("<html"), "long": Path(file).stat().st_size > 100_000}
    pictures = imageio_ffmpeg.read_frames(file)
    return result | {"size": next(pictures)["size"], "pictures": sum(1 for _ in pictures)}


def exported() -> Any:
    """Write two recordings as CSV; return the numbers of the first file."""
    recordings()
    result = answer("export walk.nc plan.nc")
    numbers = np.genfromtxt(result["files"][0], delimiter=",", skip_header=1)
    sizes = {table["recording"]: [table["rows"], table["columns"]] for table in result["tables"]}
    return {"sizes": sizes, "files": result["files"], "numbers": numbers}


def scheduler(line: str) -> Any:
    from distributed import LocalCluster

    workers: Any = LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0", processes=False)
    with workers as cluster:
        return same_with(f"--scheduler {cluster.scheduler_address}", line)


def reproduce() -> Any:
    """All claims and figures, with few starts and coarse steps."""
    import hexmj.paper.protocol as protocol

    few = {"sample": 5, "gait_starts": 1, "obstacle_starts": 2, "stride": COARSE, "gait_stride": COARSE}
    with patch.object(protocol, "QUICK", replace(protocol.QUICK, **few)):
        return answer("reproduce --quick")


@cache
def recordings() -> Any:
    """Save the recordings `walk.nc` and `plan.nc`; return the first one."""
    walk = hexmj.physical_walk(hexmj.draw_starts(2, seed=3), hexmj.UNCOORDINATED, 0.5, 30.0, forces=True)
    hexmj.save_recording(hexmj.record(walk, 0, title="walk"), Path("walk.nc"))
    plan = hexmj.record_plan(walk.planned, walk.conditions, hexmj.Stride(), start=1, title="plan")
    hexmj.save_recording(plan, Path("plan.nc"))
    return hexmj.load_recording(Path("walk.nc"))


def kinematic(*models: str) -> Any:
    """Kinematic FLSS of controllers that are loaded by name."""
    return {
        name: hexmj.flss(hexmj.load_controller(name), [0.5], n_starts=60, observation_time=60).flss.item()
        for name in models
    }


def wrappers() -> Any:
    from hexmj.controllers.wrappers import LegLost, PoorSenses

    feedback = hexmj.SensoryFeedback(hexmj.LDVS)
    wrapped = {"feedback": feedback, "lost leg": LegLost(hexmj.LDVS, 1)}
    wrapped |= {"noise": PoorSenses(feedback, noise=0.1), "delay": PoorSenses(feedback, delay=2.0)}
    starts, how = hexmj.draw_starts(2, seed=1), {"duration": 30.0, "stride": COARSE}
    return {name: vars(hexmj.physical_walk(starts, one, 0.5, **how).outcomes) for name, one in wrapped.items()}


def own_body() -> Any:
    """A robot instead of the insect."""
    robot = run_path("servo_hexapod.py")
    how: Any = {"conditions": robot["conditions"](robot["robot"](Path()), 320.0), "stride": robot["STRIDE"]}
    starts = hexmj.draw_starts(1, 0, robot["STRIDE"])
    return vars(hexmj.physical_walk(starts, robot["Larger"](), 0.5, 40.0, **how).outcomes)


def view_session() -> Any:
    """Walk live, change the velocity and push; a window and a browser show this session."""
    from hexmj.view.live import LiveWalk
    from hexmj.view.session import LiveSession

    starts = hexmj.draw_starts(2, seed=1)
    session = LiveSession(LiveWalk(hexmj.LDVS, 0.3, starts[0]), 0, starts.__getitem__)
    session.tick(0.1)
    session.attempt(lambda: session.walk.steer(0.5))
    session.attempt(lambda: session.walk.push(4.0))
    return vars(session.tick(0.1))


def measures() -> Any:
    """Functions on starts, walks and postures."""
    starts = hexmj.draw_starts(5, seed=2)
    walk = hexmj.walk(starts, hexmj.HWS, 0.8, 90.0)
    result = {"starts": starts, "x": walk.x, "first loss": hexmj.first_loss(starts, hexmj.HWS, 0.8, 90.0)}
    result |= {"loss": hexmj.loss_time(walk), "margin": hexmj.walk_margin(walk), "html": bool(walk._repr_html_())}
    feet, stance = walk.feet[:, 0], walk.stance[:, 0]
    result |= {"postures": hexmj.stability_margin(feet, stance), "polygon": hexmj.support_polygon(feet[0], stance[0])}
    result |= {"range": hexmj.flss_over_range(hexmj.LDVS, 0.1, 0.5, n_starts=500)}
    return result | {"gait": vars(hexmj.gaits.steady_state_gait(hexmj.HWS, 0.6, n_starts=3, periods=30))}


def results() -> Any:
    """Compute, save, load, plot and show results."""
    few: Any = {"velocities": [0.8], "n_starts": 6, "observation_time": 40.0}
    found = {"flss": hexmj.flss(hexmj.LDVS, **few), "compare": hexmj.compare(hexmj.LDVS, **few)}
    summaries: dict[str, Any] = {"starts": hexmj.settings(found["compare"])["starts"]}
    for name, result in found.items():
        again = hexmj.load(hexmj.save(result, Path(f"{name}.nc")))
        summaries[name] = {str(key): values.values for key, values in again.data_vars.items()}
        summaries[name] |= {"identical": result.identical(again), "axes": len(hexmj.plot(again).axes)}
    summaries["axes"] = len(hexmj.plot(recordings()).axes)
    summaries["frames"] = hexmj.render([recordings()], Path("film.mp4"), hexmj.Film(width=160, height=120))
    return summaries | {"page": Path(hexmj.page([recordings()], Path("film.html"))).stat().st_size > 100_000}


def dm_environment(actions: Any) -> Any:
    from hexmj.environments import dm

    walking = dm.load(0.5, actions=actions, duration=15.0, seed=1)
    walking.reset()
    action = walking.physics.position()[7:].copy() if actions == "joints" else np.full(18, 0.1)
    steps = [walking.step(action) for _ in range(30)]
    return {"reward": [step.reward for step in steps], **steps[-1].observation}


def gymnasium_environment(make: str, name: str = "StickInsectTips-v0", **how: Any) -> Any:
    import gymnasium

    walking = getattr(gymnasium, make)(f"hexmj.environments:hexmj/{name}", velocity=0.5, **how)
    walking.reset(seed=3)
    steps = [walking.step(np.full(walking.action_space.shape, 0.1, np.float32)) for _ in range(30)]
    frame = np.shape(walking.render()) if how.get("render_mode") else ()
    return {"reward": [step[1] for step in steps], "frame": frame, **steps[-1][0]}


def stable_baselines() -> Any:
    from hexmj.environments.stable_baselines import FeltInsects

    insects = FeltInsects(2, velocity=0.5)
    insects.seed(3)
    first, steps = insects.reset(), [insects.step(np.full((2, 18), 0.1, np.float32)) for _ in range(10)]
    return {"first": first, "last": steps[-1][0], "reward": [step[1] for step in steps]}


def examples() -> Any:
    """Import the examples that do not compute on import."""
    return {file.name: bool(run_path(file.name)) for file in EXAMPLES.glob("*.py") if "__main__" in file.read_text()}


WALK = "walk --velocity 0.5 --observation-time 16"
AHEAD = "walk --velocity 0.7 --observation-time 60 --vp 200 --dt 0.5 --physical --ground-at 45"
FLSS = "flss --starts 100 --observation-time start --velocity"
FALLS = "flss --measure physical --velocity 0.8 --starts 6 --observation-time 40"
SEARCH = "search --observation-time start --starts 20 --budget 20 --refine-budget 0 --verdict-starts 30 --form"
FILM = "--width 160 --height 120 --fps 10"
FOOT_PATH = "--vp 120 --step-height 9 --standing-height 11 --lift-time 10 --landing-time 15 --contact-gap 5"
MASSES = "--load 1 --centre-of-mass 2 --leg-mass 0.5 --friction 0.5 --grasp 0.5 --longest-substep 0.3"
MODELS = ("walknet", "tegotae", "evolved", "contact_controller.py:Feeler")

# name -> a command, which is run with --json and --out, or a function
FEATURES: dict[str, str | Callable[[], Any]] = {
    "walk kinematic": f"{WALK} --format svg",
    "walk physical": f"{WALK} --physical --start 3",
    "walk feedback": f"{WALK} --physical --feedback",
    "walk accelerating": f"{WALK} --physical --acceleration 0.01 --initial-velocity 0.2",
    "walk conditions": f"{WALK} --physical {FOOT_PATH} {MASSES} --settling-time 100",
    "walk stride": f"{WALK} --physical --dt 0.2 --geometry centred --pep0 -9 --aep0 9",
    "walk order and reading": f"{WALK} --order sequential --model-variant lasting",
    "walk grounds": lambda: {kind: answer(f"{AHEAD} --ground {kind}") for kind in ("step", "gap", "hurdle", "rough")},
    "walk text": lambda: text(f"{WALK} --physical --out text"),
    "walk settings": lambda: {"walk": answer(f"{WALK} --physical --seed 5 --load 1")["settings"]},
    "flss kinematic": f"{FLSS} 0.3 0.6 --seed 7 --format pdf",
    "flss accelerating": f"{FLSS} 0.5 --acceleration 0.001",
    "flss range of, resumption, rerun": lambda: resumed(
        "flss --velocity 0.7 --starts 600 --range-of 200 --observation-time start"
    ),
    "flss physical, resumption, rerun": lambda: resumed(FALLS),
    "flss dynamic": "flss --measure dynamic --velocity 0.6 --starts 300 --vp 40",
    "flss threads": lambda: same_with("--threads 1", f"{FLSS} 0.5"),
    "flss processes": lambda: same_with("--processes 2", f"{FLSS} 0.3 0.6"),
    "flss scheduler": lambda: scheduler(f"{FLSS} 0.3 0.5"),
    "flss progress bar": lambda: {"bar": " left" in run_command(f"{FLSS} 0.5", terminal=True)[2]},
    "controller presets": lambda: kinematic("hws", "ldvs", "uncoordinated", "own", "own-0.1", "robust-0.3", "lasting"),
    "controller rivals": lambda: kinematic("wilson", "graham", "walknet", "walknet-reacog", "walknet-load"),
    "controller more rivals": lambda: kinematic("cpg-tripod", "cpg-tetrapod", "cpg-wave", "flygym-rules", "righetti"),
    "controller TOML": lambda: kinematic("weights.toml", "fields.toml"),
    "controller file and module": lambda: kinematic("tripod.py:Tripod", "tripod:Tripod", "entry-tripod"),
    "controller without and with": lambda: kinematic("ldvs-without-3", "weights.toml-without-1", "ldvs-with-2"),
    "controller wrappers": wrappers,
    "controller physical": lambda: {name: answer(f"{FALLS} --controller {name}") for name in MODELS},
    "controller learned": f"{FALLS} --controller train_cma.py:REFLEXES",
    "check-controller": "check-controller tripod.py:Tripod",
    "check-controller fails": lambda: answer("check-controller broken.py:Broken", code=1),
    "compare precise": "compare --controller ldvs --velocity 0.7 --precision 0.2 --vp 80 160 --observation-time 20",
    "compare steady": "compare --controller graham-random --velocity 0.8 --starts 3 --protocol steady",
    "compare": lambda: resumed(
        "compare --controller hws tripod.py:Tripod --velocity 0.7 --starts 4 --observation-time 40"
    ),
    "compare text": lambda: text("compare --velocity 0.6 --starts 3 --observation-time 20 --out text"),
    "render one": lambda: shown(f"render walk.nc {FILM}"),
    "render two": lambda: shown(f"render walk.nc plan.nc {FILM} --camera side"),
    "render GIF": lambda: shown(f"render walk.nc {FILM} --camera top --format gif --quality high"),
    "render planned": lambda: shown(
        f"render {FILM} --velocity 0.5 --observation-time 8 --beside planned --slow-motion 4"
    ),
    "render beside": lambda: shown(f"render {FILM} --velocity 0.5 --observation-time 8 --beside hws --camera front"),
    "page": lambda: [shown("page walk.nc"), shown("page walk.nc plan.nc")],
    "export": exported,
    "view live": lambda: view("--velocity 0.5"),
    "view recording": lambda: view("walk.nc"),
    "view session": view_session,
    "task": lambda: resumed("task turn push --starts 2 --dt 0.5 --controller graham tripod.py:Tripod"),
    "task file": "task mine.toml --starts 2 --dt 0.5",
    "league": "league --quick --starts 2 --dt 0.5 --tasks slow step --controller ldvs free tripod.py:Tripod",
    "league list": lambda: text("league --list"),
    "biology": "biology --starts 1 --periods 4",
    "reproduce claims": "reproduce --quick --only hws-close ideal-0.4 p4 --beside lasting",
    "reproduce figures": reproduce,
    "search evolution": lambda: resumed(f"{SEARCH} hws --velocity 0.5"),
    "search refined": f"{SEARCH.replace('--refine-budget 0', '--refine-budget 8')} hws --velocity 0.5",
    "search CMA-ES": f"{SEARCH} ldvs --velocity 0.5 --algorithm cmaes",
    "search range": f"{SEARCH} mirrored --velocity 0.3 0.6 --begin hws --ties later",
    "search over variants": f"{SEARCH} hws --velocity 0.5 --over mean",
    "search fields": f"{SEARCH} tripod.py:Tripod --velocity 0.5",
    "search dynamic": f"{SEARCH.replace('20', '10')} hws --velocity 0.5 --measure dynamic --vp 40",
    "search physical": f"{SEARCH.replace('20', '10')} hws --velocity 0.7 --measure physical --vp 200 --dt 0.5",
    "doctor": lambda: {check["name"]: True for check in json.loads(run_command("doctor --json")[1])["checks"]},
    "errors": lambda: [text("flss --velocity 1.5"), text("walk --controller nothing")],
    "process": lambda: [process("--help"), process("--version"), process(f"{FLSS} 0.5 --json")],
    "python names": lambda: {name: True for name in dir(hexmj) if not ismodule(getattr(hexmj, name))},
    "python measures": measures,
    "python results": results,
    "python own body": own_body,
    "python dm_env": lambda: [dm_environment("tips"), dm_environment("joints")],
    "python Gymnasium": lambda: gymnasium_environment("make", render_mode="rgb_array"),
    "python Gymnasium joints": lambda: gymnasium_environment("make", "StickInsect-v0"),
    "python vector": lambda: gymnasium_environment("make_vec", num_envs=3),
    "python stable-baselines3": stable_baselines,
    "python examples": examples,
    # This one becomes a script.
}

OPTIONAL = {
    "flss scheduler": "distributed",
    "view live": "viser",
    "python stable-baselines3": "stable_baselines3",
    "python dm_env": "dm_control",
    "python examples": "dm_control",
}


def normal(value: Any, key: str = "") -> Any:
    """Return short, plain data without what depends on the machine; texts of several words are not compared."""
    value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if key == "files" and isinstance(value, list):
        return {Path(name).name: True for name in sorted(value)}
    if isinstance(value, dict):
        return {str(name): normal(one, str(name)) for name, one in value.items() if name not in IGNORED}
    if isinstance(value, str):
        return "a text" if " " in value else value
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    if not isinstance(value, list | tuple):
        return value
    numbers = np.empty(0)
    with suppress(TypeError, ValueError):
        numbers = np.array(value, dtype=float)
    if numbers.size <= LONGEST:
        return [normal(one) for one in value]
    known, n = numbers[np.isfinite(numbers)], numbers.size
    moments = [known.mean(), known.min(), known.max(), known @ np.linspace(0, 1, len(known))] if known.size else []
    return normal({"shape": numbers.shape, "finite": known.size, "moments": moments, "some": numbers.flat[:: n // 3]})


def differences(expected: Any, found: Any, path: str = "") -> Iterator[str]:
    """Yield the path and both values of everything that differs."""
    if isinstance(expected, dict) and isinstance(found, dict):
        for key in sorted((expected.keys() | found.keys()) - IGNORED):
            yield from differences(expected.get(key, "missing"), found.get(key, "missing"), f"{path}/{key}")
    elif isinstance(expected, list) and isinstance(found, list) and len(expected) == len(found):
        for n, pair in enumerate(zip(expected, found, strict=True)):
            yield from differences(*pair, f"{path}/{n}")
    elif isinstance(expected, float) and isinstance(found, float) and math.isclose(expected, found, **TOLERANCE):
        return
    elif expected != found:
        yield f"{path}: {found!r:.200}, in the reference {expected!r:.200}"


def check(name: str, reference: dict[str, Any], record: bool) -> bool:
    """Run a feature, print a line, and return whether it passed."""
    begun, verdict, lines, feature = time.perf_counter(), "ok", [], FEATURES[name]
    try:
        found = json.loads(json.dumps(normal(answer(feature) if isinstance(feature, str) else feature())))
    except Exception as error:
        verdict, lines = "failed", [f"{type(error).__name__}: {error}"[:1000]]
    else:
        if record:
            reference[name] = found
        elif lines := list(differences(reference.get(name, "missing"), found)):
            verdict, lines = "differs", [*lines[:20], *([f"and {len(lines) - 20} more"] if len(lines) > 20 else [])]
    print(f"{verdict:8}{time.perf_counter() - begun:6.1f} s  {name}", *lines, sep="\n          ", flush=True)
    return verdict == "ok"


def main(words: list[str]) -> int:
    names, record = tuple(word for word in words if word != "--record"), "--record" in words
    recorded = REFERENCE.read_text() if REFERENCE.exists() else "{}"
    for old, new in RENAMED.items():
        recorded = recorded.replace(f'"{old}"', f'"{new}"')
    reference = json.loads(recorded)
    left_out = [feature for feature, package in OPTIONAL.items() if not find_spec(package)]
    chosen = [name for name in FEATURES if name.startswith(names or "")]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job of a shell ignores it
    with TemporaryDirectory(prefix="hexmj-features-", ignore_cleanup_errors=True) as folder, chdir(folder):
        for name, content in USER_FILES.items():
            Path(name).parent.mkdir(exist_ok=True)
            Path(name).write_text(content)
        passed = [check(name, reference, record) for name in chosen if name not in left_out]
    if record:
        lines = (f"{json.dumps(name)}: {json.dumps(reference[name])}" for name in FEATURES if name in reference)
        REFERENCE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    print("".join(f"left out, since a package is not installed: {name}\n" for name in left_out), end="")
    print(f"{sum(passed)} features passed, {len(passed) - sum(passed)} failed")
    return 0 if passed and all(passed) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
