"""Ctrl-C and SIGTERM at any moment: the command says that it was stopped, and leaves nothing half written."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import hexmj
from tiers import few_of

ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(hexmj.__file__).parents[1])}


def started(*words: str, until: Path | None = None, wait: float = 0.0) -> subprocess.Popen[bytes]:
    """The command in a process group of its own, once there is a file or some time [s] has gone by."""
    running = subprocess.Popen(
        [sys.executable, "-m", "hexmj", *words],
        env=ENVIRONMENT,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    while until and not list(until.parent.glob(until.name)):
        assert running.poll() is None, running.communicate()
        time.sleep(0.01)
    time.sleep(wait)
    return running


def stopped(running: subprocess.Popen[bytes], by: signal.Signals, group: bool = False) -> None:
    """It ends soon after a signal, to itself or, as from a terminal, to its whole group; and says so."""
    try:
        os.killpg(running.pid, by) if group else running.send_signal(by)
        out, error = running.communicate(timeout=30)
    finally:
        running.kill()
    assert running.returncode == 130, error
    said = [line for line in error.splitlines() if b"% in " not in line]  # progress, on a busy machine
    assert len(said) == 1 and said[0].startswith(b"hexmj: stopped"), error
    assert out == b""


@pytest.mark.parametrize(
    "how", [["-m", "hexmj"], [str(Path(sys.executable).with_name("hexmj"))]], ids=["module", "script"]
)
@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_before_it_hears_them(by, how):
    """While the package itself is imported, of which Python tells on the way."""
    words = [sys.executable, "-X", "importtime", *how, "flss"]
    with subprocess.Popen(words, env=ENVIRONMENT, stderr=subprocess.PIPE) as running:
        assert running.stderr
        while b"hexmj.process.early_stops" not in running.stderr.readline():
            assert running.poll() is None
        running.send_signal(by)
        told = running.stderr.read()
    assert running.returncode == 130 and b"hexmj: stopped" in told and b"Traceback" not in told


@pytest.mark.thorough
def test_no_program_is_started_that_a_stop_would_reach(tmp_path):
    """As GLFW does to ask libraries for their versions."""
    heard = "lambda event, _: event == 'subprocess.Popen' and print('started a program', flush=True)"
    script = f"import sys\nfrom hexmj.__main__ import main\nsys.addaudithook({heard})\nmain()"
    words = "flss --physical --velocities 0.5 --starts 1 --observation time 5 --threads 1"
    done = subprocess.run(
        [sys.executable, "-c", script, *words.split()], env=ENVIRONMENT, capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0 and "FLSS" in done.stdout and "started" not in done.stdout


@pytest.mark.parametrize("module", ["tyro", "numpy", "mujoco"])
@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_while_it_is_imported(by, module):
    """While a module that the command needs is being looked for; and once more as the program ends."""
    script = (
        "import atexit, os, sys\n"
        f"atexit.register(os.kill, os.getpid(), {int(by)})\n"
        "class Stop:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name == {module!r}: os.kill(os.getpid(), {int(by)})\n"
        "from hexmj.__main__ import main\n"
        "sys.meta_path.insert(0, Stop())\n"
        "main()"
    )
    words = [sys.executable, "-c", script, "flss", "--physical", "--starts", "5000"]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True)
    assert (done.returncode, done.stdout, done.stderr.strip()) == (130, b"", b"hexmj: stopped")


POOLS = {
    "is made": (
        "from multiprocessing import resource_tracker as tracker\n"
        "usual = tracker.register\n"
        "tracker.register = lambda *one: (usual(*one), os.kill(os.getpid(), 2))\n"
    ),
    "is left": (
        "from concurrent.futures import ProcessPoolExecutor as Pool\n"
        "usual = Pool.shutdown\n"
        "Pool.shutdown = lambda *some, **more: (os.kill(os.getpid(), 2), usual(*some, **more))\n"
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("when", few_of(POOLS, "is left"))
def test_while_a_pool_of_processes(when, tmp_path):
    """Its semaphores are left to nobody, who would be told of them."""
    script = f"import os\n{POOLS[when]}from hexmj.__main__ import main\nmain()"
    words = [sys.executable, "-c", script, "flss", "--velocities", "0.5", "--starts", "9", "--processes", "2"]
    words += ["--out", str(tmp_path)]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, timeout=60)
    progress, last = done.stderr.splitlines()[:-1], done.stderr.splitlines()[-1]
    assert done.returncode == 130, done.stderr
    assert all(b"%" in line for line in progress)
    assert last == b"hexmj: stopped; what is finished is kept. Repeat the command to go on"


def test_while_c_code_calls_back():
    """As numba does while it loads compiled code; what such a callback raises goes no farther."""
    script = (
        "import ctypes, os, sys\n"
        "callback = ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), 2))\n"
        "class Stop:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'mujoco':\n"
        "            callback()\n"
        "from hexmj.__main__ import main\n"
        "sys.meta_path.insert(0, Stop())\n"
        "main()"
    )
    words = [sys.executable, "-c", script, "flss", "--physical", "--starts", "5000"]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr.strip()) == (130, b"", b"hexmj: stopped")


@pytest.mark.slow
@pytest.mark.parametrize("other", ["SystemError", "RuntimeError", "OSError", "MemoryError", "SystemExit"])
def test_while_something_makes_another_exception_of_it(tmp_path, other):
    """As C code that is being called does, and a class that is being made; in a sweep, too, whose workers end."""
    script = (
        "import os, sys\n"
        "class Stop:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'hexmj.physics.chunks':\n"
        "            try: os.kill(os.getpid(), 15)\n"
        f"            except KeyboardInterrupt: raise {other}('of a stop')\n"
        "from hexmj.__main__ import main\n"
        "sys.meta_path.insert(0, Stop())\n"
        "main()"
    )
    words = ["map", "--velocities", "0.1", "--starts", "2", "--over", "friction", "--values", "1", "--observation time", "2"]
    done = subprocess.run(
        [sys.executable, "-c", script, *words, "--out", str(tmp_path)], env=ENVIRONMENT, capture_output=True, timeout=60
    )
    said = b"hexmj: stopped; what is finished is kept. Repeat the command to go on\n"
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", said)


@pytest.mark.parametrize(("words", "code"), [(["doctor", "--help"], 0), (["flss", "--starts", "0"], 2)])
def test_after_all_is_said(words, code):
    """In the interpreter's own end a stop changes nothing: what was said holds."""
    script = (
        "import os, signal, sys\n"
        "class End:\n"
        "    def __del__(self, kill=os.kill, own=os.getpid()): kill(own, 15)\n"
        "sys.kept_to_the_end = End()\n"
        "from hexmj.__main__ import main\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", script, *words], env=ENVIRONMENT, capture_output=True, timeout=60)
    assert done.returncode == code, done.stderr
    assert b"stopped" not in done.stderr


CTRL_C = signal.SIGINT, True


@pytest.mark.slow
@pytest.mark.parametrize(("by", "group"), few_of([(signal.SIGTERM, False), CTRL_C], CTRL_C), ids=["SIGTERM", "ctrl-c"])
def test_while_a_film_is_written(tmp_path, by, group):
    stopped(started("render", "--observation time", "200", "--out", str(tmp_path), until=tmp_path / ".part-*.mp4"), by, group)
    assert [path.name for path in tmp_path.iterdir()] == ["ldvs-V-0.3-1.nc"]


STOPS = [
    (signal.SIGTERM, False, 4.0),
    (signal.SIGINT, True, 4.0),
    (signal.SIGTERM, True, 4.0),
    (signal.SIGHUP, True, 1.5),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("by", "group", "wait"), few_of(STOPS, *STOPS[:2], STOPS[3]), ids=["SIGTERM", "ctrl-c", "timeout", "terminal"]
)
def test_while_processes_compute_cells(tmp_path, by, group, wait):
    """They end at once, too, whoever is told first; their cells may be long."""
    words = ("compare", "--velocities", "0.1", "0.5", "--starts", "60", "--no-video", "--processes", "2")
    stopped(started(*words, "--out", str(tmp_path / "out"), wait=wait), by, group)
    assert not list(tmp_path.rglob("manifest.json"))


@pytest.mark.slow
@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGHUP])
def test_while_a_search_evaluates(tmp_path, by):
    out = tmp_path / "evaluations"
    stopped(started("search", "--out", str(tmp_path), until=out / "population-*.jsonl", wait=1.0), by)
    assert {path.suffix for path in out.iterdir()} == {".jsonl"}, "the lock is gone, the evaluations are not"


def test_a_stop_that_somebody_swallows_comes_once_more():
    script = (
        "import os, signal, time\n"
        "from hexmj.process import signals\n"
        "signals.SWALLOWED = 0.3\n"
        "signals.hear_stops()\n"
        "for told in ('swallowed', 'heard'):\n"
        "    try:\n"
        "        if told == 'swallowed':\n"
        "            os.kill(os.getpid(), signal.SIGTERM)\n"
        "        time.sleep(20)\n"
        "    except KeyboardInterrupt:\n"
        "        print(told)\n"
        "signals.ignore_stops()\n"
    )
    begun = time.monotonic()
    done = subprocess.run([sys.executable, "-c", script], env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["swallowed", "heard"]
    assert time.monotonic() - begun < 15
