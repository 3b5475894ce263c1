"""Sweeps on a Dask cluster, started as a user would: the same bits, and whatever goes away leaves what is finished."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

import pytest
import xarray as xr
from hexmj.sweeps.cluster import workers_of

from hexmj.controllers.cruse1998 import LDVS
from hexmj.errors import InputError
from hexmj.measures.compare import compare
from hexmj.measures.kinematic import flss
from hexmj.sweep import Cell, run_cells
from left_by_cells import calls, contents
from small_cells import ENVIRONMENT, counted_cells, odd_cells
from tiers import few_of

DASK = [sys.executable, "-m", "dask"]
WORKERS = ("--nworkers", "2", "--nthreads", "1", "--no-dashboard", "--death-timeout", "60")
FORGIVING = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
"""A cell that kills two workers is given up, after four otherwise."""

RANGES = ("flss", "--velocities", "0.7", "--observation time", "start", "--starts", "20000", "--range-of", "400")


@contextmanager
def started(
    *words: str,
    output: int = subprocess.DEVNULL,
    folder: Path | None = None,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[subprocess.Popen[bytes]]:
    """A program in a session of its own, which is killed in the end whatever happens."""
    program = subprocess.Popen(
        words, cwd=folder, env=ENVIRONMENT | {**environment}, start_new_session=True, stdout=output, stderr=output
    )
    try:
        yield program
    finally:
        with suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGKILL)
        program.communicate()


@contextmanager
def scheduler(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler on loopback, by its address and its process."""
    told = folder / "scheduler-file"
    words = "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(told)
    with started(*DASK, "scheduler", *words, folder=folder, environment=FORGIVING) as program:
        wait_for(lambda: told.exists() and told.read_text().endswith("}"))
        yield json.loads(told.read_text())["address"], program


@contextmanager
def workers(address: str, folder: Path, environment: Mapping[str, str] = MappingProxyType({})) -> Iterator[None]:
    """Two workers of one thread each, with nannies."""
    words = address, *WORKERS, "--local-directory", str(folder / "scratch")
    with started(*DASK, "worker", *words, folder=folder, environment=environment):
        yield


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("cluster")
    with scheduler(folder) as (address, _), workers(address, folder):
        yield address


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "hexmj", *map(str, words)]


def wait_for(what: Callable[[], object], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < until, "it did not happen"
        time.sleep(0.02)


def finished(out: Path) -> int:
    return len([*(out / "walks").glob("*.nc")])


# The same bits


def but_for_progress(error: bytes) -> bytes:
    """What a command says beside the lines that tell that it connects and, every few seconds, how far it has come."""
    usual = b"% in ", b"hexmj: connecting to the scheduler at "
    return b"".join(line for line in error.splitlines(keepends=True) if not any(one in line for one in usual))


@pytest.mark.slow
def test_a_local_cluster_gives_the_bits_of_one_process(tmp_path: Path, cluster: str) -> None:
    """Odd numbers, kinematic ranges, physical walks; in files and in memory, by our executor and by Dask's own."""
    from distributed import Client

    def odd(**how: Any) -> xr.Dataset:
        return xr.concat(run_cells(odd_cells(4), **how), "cell")

    def ranges(**how: Any) -> xr.Dataset:
        return flss(LDVS, [0.5, 0.7], n_starts=2500, observation_time="start", range_of=700, **how)

    def walks(**how: Any) -> xr.Dataset:
        return compare(LDVS, [0.3, 0.5], n_starts=2, observation_time=5.0, **how)

    with workers_of(cluster) as ours, Client(cluster) as client:
        for found in (odd, ranges, walks):
            kept = tmp_path / found.__name__
            here = found(folder=kept / "here")
            for name, executor in {"ours": ours, "dask": client.get_executor(pure=False, retries=2)}.items():
                assert found(folder=kept / name, executor=executor).identical(here)
                assert found(executor=executor).identical(here)
                assert contents(kept / name) == contents(kept / "here")


@pytest.mark.thorough
def test_a_command_waits_for_workers_and_says_nothing_else(tmp_path: Path) -> None:
    words = ("flss", "--velocities", "0.5", "0.7", "--starts", "2500", "--observation time", "start", "--json")
    with scheduler(tmp_path) as (address, _):
        out = ("--range-of", 700, "--scheduler", address, "--out", tmp_path / "cluster")
        with started(*command(*words, *out), output=subprocess.PIPE) as program:
            assert program.stderr
            assert program.stderr.readline().decode() == f"hexmj: connecting to the scheduler at {address}\n"
            note = f"hexmj: the scheduler at {address} has no workers yet; cells wait for them\n"
            assert program.stderr.readline().decode() == note
            with workers(address, tmp_path):
                answer, error = program.communicate(timeout=100)
    assert (program.returncode, but_for_progress(error)) == (0, b"")
    alone = subprocess.run(
        command(*words, "--out", tmp_path / "here"), capture_output=True, check=True, env=ENVIRONMENT
    )
    one, other = json.loads(answer), json.loads(alone.stdout)
    assert one.pop("files") != other.pop("files")
    assert one == other
    for name in ("flss.nc", "flss.png", "manifest.json"):
        assert (tmp_path / "cluster" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()


def together(log: str, number: int) -> xr.Dataset:
    """Ends only when two have begun."""
    Path(log, f"begun-{os.getpid()}").touch()
    wait_for(lambda: len([*Path(log).glob("begun-*")]) == 2)
    return xr.Dataset({"number": number / 3})


@pytest.mark.slow
def test_a_cell_that_runs_twice_at_once_is_one_file(tmp_path: Path, cluster: str) -> None:
    cell, folder = Cell("twice", together, {"log": str(tmp_path), "number": 2}), tmp_path / "kept"
    with workers_of(cluster) as one, ThreadPoolExecutor(2) as pool:
        both = [pool.submit(run, [cell], folder, executor=one) for _ in range(2)]
        first, second = (future.result()[0] for future in both)
    assert first.identical(second)
    assert len([*tmp_path.glob("begun-*")]) == 2
    assert [path.name for path in folder.iterdir()] == [f"{cell.stem(cell.record())}.nc"]


# What goes away


def dies_once(log: str, number: int) -> xr.Dataset:
    """Of SIGKILL in the middle of the first cell that is begun."""
    try:
        Path(log, "died").touch(exist_ok=False)
    except FileExistsError:
        return xr.Dataset({"number": number / 3})
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


@pytest.mark.slow
def test_a_worker_that_is_killed_in_the_middle_of_a_cell(tmp_path: Path, cluster: str) -> None:
    cells = [Cell(f"{i}", dies_once, {"log": str(tmp_path), "number": i}) for i in range(6)]
    with workers_of(cluster) as executor:
        found = run_cells(cells, tmp_path / "kept", executor=executor)
    assert (tmp_path / "died").exists()
    assert [one.number.item() for one in found] == [i / 3 for i in range(6)]
    assert len(contents(tmp_path / "kept")) == 6


def dies(number: int) -> xr.Dataset:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError(number)


@pytest.mark.slow
def test_a_cell_that_kills_its_workers_is_a_sentence(tmp_path: Path, cluster: str) -> None:
    cells = [*counted_cells(tmp_path, 3), Cell("deadly", dies, {"number": 1})]
    with (
        pytest.raises(
            InputError, match=r"^a cell killed 2 workers, the last one at tcp://.* more memory for each worker"
        ),
        workers_of(cluster) as executor,
    ):
        run_cells(cells, tmp_path / "kept", executor=executor)
    with ThreadPoolExecutor(1) as pool:
        assert len(run_cells(cells[:3], tmp_path / "kept", executor=pool)) == 3
    assert sorted({*calls(tmp_path)}) == ["0", "1", "2"]


def test_an_executor_that_is_shut_down_meanwhile_is_a_sentence(tmp_path: Path) -> None:
    cells = counted_cells(tmp_path, 6, wait=0.3)
    with ThreadPoolExecutor(1) as pool:
        threading.Timer(0.5, lambda: pool.shutdown(wait=False, cancel_futures=True)).start()
        with pytest.raises(InputError, match="what computed cells has gone away"):
            run_cells(cells, tmp_path / "kept", executor=pool)
    assert 1 <= len(contents(tmp_path / "kept")) < 6


def test_an_executor_that_gives_no_future_is_a_sentence(tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as pool:
        pool.submit = lambda *asked: 3  # pyright: ignore[reportAttributeAccessIssue]
        with pytest.raises(InputError, match=r"gave 3; expected a concurrent\.futures\.Future"):
            run_cells(counted_cells(tmp_path, 2), tmp_path / "kept", executor=pool)


@pytest.mark.slow
@pytest.mark.parametrize("gone", few_of(["scheduler", "ctrl-c"], "scheduler"))
def test_a_command_that_loses_its_scheduler_or_is_stopped_keeps_what_is_finished(tmp_path: Path, gone: str) -> None:
    out = tmp_path / "out"
    with (
        scheduler(tmp_path) as (address, program),
        workers(address, tmp_path),
        started(*command(*RANGES, "--scheduler", address, "--out", out), output=subprocess.PIPE) as sweep,
    ):
        wait_for(lambda: finished(out) > 3)
        if gone == "scheduler":
            program.kill()
        else:
            sweep.send_signal(signal.SIGINT)
        answer, error = sweep.communicate(timeout=30)
    lost = b"hexmj: what computed cells has gone away, as a scheduler that is stopped; what is finished is kept"
    lost, stopped = (
        lost + b": start again\n",
        b"hexmj: stopped; what is finished is kept. Repeat the command to go on\n",
    )
    assert (told := but_for_progress(error)).endswith(expected := lost if gone == "scheduler" else stopped)
    assert told.removesuffix(expected).count(b"\n") <= 1, "but for the note that no workers are there yet"
    assert (sweep.returncode, answer) == ((2 if gone == "scheduler" else 130), b"")
    before = {name: one for name, one in contents(out / "walks").items() if not name.startswith(".") and ".nc" in name}
    assert 3 < len(before) < 50
    subprocess.run(command(*RANGES, "--out", out), check=True, capture_output=True, env=ENVIRONMENT)
    assert before.items() <= contents(out / "walks").items()
    assert not [name for name in contents(out / "walks") if not name.endswith(".nc")]
    with xr.open_dataset(out / "flss.nc", engine="h5netcdf") as found:
        whole = flss(LDVS, [0.7], n_starts=20_000, observation_time="start")
        assert all(found[name].equals(whole[name]) for name in whole.variables)


# Workers that are not as they should be


@pytest.mark.slow
def test_workers_with_other_code_are_refused(tmp_path: Path) -> None:
    root = Path(__file__).parents[1]
    for name in ("hexmj", "assets"):
        shutil.copytree(root / name, tmp_path / "other" / name, ignore=shutil.ignore_patterns("__pycache__"))
    with (tmp_path / "other" / "hexmj" / "timing.py").open("a") as file:
        file.write("# edited\n")
    paths = os.pathsep.join(map(str, (tmp_path / "other", root / "tests")))
    with scheduler(tmp_path) as (address, _), workers(address, tmp_path, {"PYTHONPATH": paths}):
        for folder in (tmp_path / "kept", None):
            with (
                pytest.raises(
                    InputError, match=r"a worker on \S+ lacks or has another hexmj.timing of sources than the sender"
                ),
                workers_of(address) as executor,
            ):
                flss(LDVS, [0.7], n_starts=10, observation_time="start", folder=folder, executor=executor)
    assert not [*(tmp_path / "kept").iterdir()]


class Elsewhere(Executor):
    """A machine with a disk of its own, on which a folder of the same name lies."""

    def __init__(self, here: Path, there: Path) -> None:
        self.here, self.there = here, there

    def submit(self, fn, /, *args, **kwargs):  # pyright: ignore[reportIncompatibleMethodOverride]
        parcel, future = cast(Any, fn), Future[xr.Dataset]()
        given = *parcel.args, *args
        moved = [self.there / one.relative_to(self.here) if isinstance(one, Path) else one for one in given]
        try:
            future.set_result(parcel.func(*moved))
        except InputError as error:
            future.set_exception(error)
        return future


def test_a_worker_that_does_not_see_the_folder_computes_nothing(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    (there / "kept").mkdir(parents=True)
    with pytest.raises(
        InputError, match=r"a worker on \S+ does not see the folder .*there/kept; expected it to be shared"
    ):
        run_cells(counted_cells(tmp_path, 2), here / "kept", executor=Elsewhere(here, there))
    assert (contents(here / "kept"), contents(there / "kept"), calls(tmp_path)) == ({}, {}, [])
    assert len(run_cells(counted_cells(tmp_path, 2), here / "kept", executor=Elsewhere(here, here))) == 2


def test_a_relative_folder_is_one_place_for_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers may have begun in another current folder."""
    monkeypatch.chdir(tmp_path)

    class Moved(Executor):
        def submit(self, fn, /, *args, **kwargs):  # pyright: ignore[reportIncompatibleMethodOverride]
            with monkeypatch.context() as moved:
                moved.chdir("/")
                (future := Future[xr.Dataset]()).set_result(fn(*args, **kwargs))
            return future

    run_cells(counted_cells(tmp_path, 2), Path("kept"), executor=Moved())
    assert len(contents(tmp_path / "kept")) == 2


# Words that make no sense


@pytest.mark.slow
def test_an_executor_that_has_lost_its_scheduler_is_refused_at_once(tmp_path: Path) -> None:
    with scheduler(tmp_path) as (address, _), workers_of(address) as executor:
        pass
    with pytest.raises(InputError, match=r"^executor = .* has lost its scheduler; expected one of a client that has"):
        flss(LDVS, [0.5], n_starts=2, executor=executor)


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_a_sentence(tmp_path: Path) -> None:
    """Nobody is there; or somebody is who says nothing."""
    from socket import create_server

    with create_server(("127.0.0.1", 0)) as mute, create_server(("127.0.0.1", 0)) as closed:
        addresses = [f"tcp://127.0.0.1:{one.getsockname()[1]}" for one in (mute, closed)]
        closed.close()
        words = [command(*RANGES, "--scheduler", address, "--out", tmp_path / "out") for address in addresses]
        with started(*words[0], output=subprocess.PIPE) as one, started(*words[1], output=subprocess.PIPE) as other:
            for address, program in zip(addresses, (one, other), strict=True):
                answer, error = program.communicate(timeout=60)
                said = f"hexmj: no scheduler answers at {address}; expected the address that `dask scheduler` prints\n"
                assert but_for_progress(error).decode() == said
                assert (program.returncode, answer) == (2, b"")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("flss", "--scheduler", "nonsense"), "scheduler = 'nonsense': missing port number in address 'nonsense'"),
        (("map", "--scheduler", "foo://x"), "scheduler = 'foo://x': unknown address scheme 'foo'"),
        (("map", "--scheduler", "inproc://x"), "scheduler = 'inproc://x'; expected an address that is a scheduler's"),
        (("compare", "--scheduler", "tcp://a:1", "--processes", "2"), "--scheduler and --processes = 2; expected one"),
        (("flss", "--physical", "--range-of", "10"), "--range-of = 10 with --physical; expected it with kinematic"),
        (("flss", "--range-of", "0"), "range_of = 0; expected a whole number of at least 1"),
    ],
)  # fmt: skip
def test_words_that_make_no_sense(run, tmp_path: Path, words: tuple[str, ...], sentence: str) -> None:
    code, out, error = run_cells(*words, "--out", tmp_path / "out")
    *before, last = error.splitlines()
    assert (code, out) == (2, "") and last.startswith(f"hexmj: {sentence}")
    assert before in ([], [f"hexmj: connecting to the scheduler at {words[2]}"]), "and no line of progress"
    assert not (tmp_path / "out").exists()


def test_without_dask_one_sentence_says_how_it_is_installed(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, error = run_cells("flss", "--scheduler", "tcp://127.0.0.1:8786")
    assert (code, error.count("\n")) == (2, 1)
    assert "distributed, which a scheduler needs, is not installed" in error
    assert 'pip install ".[dask]"' in error
