"""What workers have read and remember, and what is sent to them, counts as it does where a sweep begins."""

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

from hexmj.errors import InputError
from hexmj.sweep import Cell, cells, run_cells
from hexmj.sweeps.cells import unlike
from hexmj.user_code import opened_files
from hexmj.user_code.loaded import importable
from reader import READER, another_program, what_was_read


@pytest.mark.parametrize("edited", [False, True])
def test_what_an_object_remembers_is_not_sent_to_workers(
    computed: Callable[..., tuple[float, int]], edited: bool
) -> None:
    with ProcessPoolExecutor(1) as pool:
        pool.submit(os.getpid).result()
        Path("reader.py").write_text(READER.format(gain="self.known"))
        reader = importable("reader.py").Reader()
        assert reader.known == 1.0
        if edited:
            Path("one/gain").write_text("7.0")
        (data,) = run_cells([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)
    assert data.gain == (7.0 if edited else 1.0)
    assert reader.known == 1.0
    assert what_was_read() == {"one/gain"}


def test_a_field_over_something_that_is_computed_once_is_sent(computed: Callable[..., tuple[float, int]]) -> None:
    Path("reader.py").write_text(
        f"{READER.format(gain='self.known')}\n@dataclass(frozen=True)\nclass Known(Reader):\n    known: float = 3.0"
    )
    with ProcessPoolExecutor(1) as pool:
        (data,) = run_cells([Cell("reader", importable("reader.py").Known(known=4.0).cell, {})], Path("kept"), executor=pool)
    assert data.gain == 4.0


def test_a_worker_that_outlives_a_program_keeps_nothing_of_what_it_remembers(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    gain = "doubled(self)"
    Path("reader.py").write_text(
        f"{READER.format(gain=gain)}\n@functools.cache\ndef doubled(reader):\n    return 2 * reader.known"
    )
    reader = importable("reader.py").Reader()
    with ProcessPoolExecutor(1) as pool:
        pool.submit(os.getpid).result()
        assert reader.known == 1.0
        run_cells([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)
        another_program(monkeypatch)
        Path("one/gain").write_text("7.0")
        reader = importable("reader.py").Reader()
        assert reader.known == 7.0
        with pytest.warns(UserWarning, match="reader is not kept: .*one.gain has changed since"):
            run_cells([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)


@pytest.mark.parametrize(
    ("gain", "told"),
    [
        ("runpy.run_path('values' + '.py')['GAIN']", "runs .*values.py, of which an edit"),
        ("[float(Path('one/gain').read_text()), Path('one/gain').write_text('7.0')][0]", "one.gain has changed"),
    ],
)
def test_a_cell_that_sweeps_in_processes_is_no_more_kept_than_what_it_sweeps(
    computed: Callable[..., tuple[float, int]], gain: str, told: str
) -> None:
    Path("values.py").write_text("GAIN = 1.0")
    Path("inner_reader.py").write_text(READER.format(gain=gain))
    pool = "__import__('concurrent.futures').futures.ProcessPoolExecutor(1)"
    inner = "hexmj.sweeps.Cell('inner', importable('inner_reader.py').Reader().cell, {})"
    gain = f"hexmj.sweep.run_cells([{inner}], executor={pool})[0].gain.item()"
    for n in (1, 2):  # what it has seen of the first one, the code may remember
        with pytest.warns(UserWarning, match=f"^reader is not kept: inner is not kept: [^:]*{told}[^:]*$"):
            computed(f"[importable := hexmj.user_code.loaded.importable, {gain}][1]", f"file {n}")
    assert not [*Path("kept").glob("*.nc")]


@pytest.mark.parametrize("ends", ["{}", "exit(3)"])
@pytest.mark.parametrize("how", ["fails()", "ThreadPoolExecutor(1).submit(fails).result()"])
@pytest.mark.usefixtures("computed")
def test_a_cell_that_goes_on_where_a_cell_elsewhere_has_failed_is_not_kept(how: str, ends: str) -> None:
    Path("one/gain").write_text("-1.0")
    Path("reader.py").write_text(
        READER.format(gain=f"0.0 if {how} else 1.0")
        + f"""
@dataclass(frozen=True)
class Failing:
    def cell(self):
        return Inner().cell() if float(Path("one/gain").read_text()) > 0 else {ends}
"""
        + """

def fails():
    with __import__("concurrent.futures").futures.ProcessPoolExecutor(1) as pool:
        try:
            hexmj.sweep.run_cells([hexmj.sweeps.Cell("failing", Failing().cell, {})], executor=pool)
        except (hexmj.InputError, SystemExit):
            return True
"""
    )
    with pytest.warns(UserWarning, match="^reader is not kept: a cell that was swept elsewhere has failed"):
        (data,) = run_cells([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
    assert data.gain == 0.0
    assert not [*Path("kept").glob("*.nc")]


def test_a_worker_that_outlives_a_program_knows_nothing_of_what_that_has_opened(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("reader.py").write_text(READER.format(gain="1.0"))
    with ProcessPoolExecutor(1) as pool:
        pool.submit(os.getpid).result()
        for gain in (1.0, 2.0):
            Path("one/gain").write_text(str(gain))
            reader = importable("reader.py")
            assert reader.tried("one/gain") == gain
            run_cells([Cell("reader", reader.Reader().cell, {})], Path("kept"), executor=pool)
            another_program(monkeypatch)


def test_a_folder_that_was_looked_for_before_it_was_made_is_no_data_of_a_worker_s(
    computed: Callable[..., tuple[float, int]],
) -> None:
    Path("reader.py").write_text(READER.format(gain="1.0"))
    reader = importable("reader.py")
    assert reader.tried("kept/made") == 0.0
    Path("kept/made").mkdir(parents=True)
    with ProcessPoolExecutor(1) as pool:
        run_cells([Cell("reader", reader.Reader().cell, {})], Path("kept"), executor=pool)
    assert what_was_read() == set()


def test_a_worker_elsewhere_may_have_a_field_s_file_of_its_own(computed: Callable[..., tuple[float, int]]) -> None:
    Path("two/gain.txt").write_text("2.0")
    Path("gain.txt").write_text("2.0")
    Path("reader.py").write_text(READER.format(gain="float(Path(self.file).read_text())"))
    module = importable("reader.py")
    reader = module.Reader(file="gain.txt")
    assert module.tried("gain.txt") == 2.0
    with ProcessPoolExecutor(1, initializer=os.chdir, initargs=("two",)) as pool:
        (data,) = run_cells([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)
    assert data.gain == 2.0
    assert what_was_read() == set()


def test_what_workers_cells_write_is_no_other_data_in_the_next_sweep(
    computed: Callable[..., tuple[float, int]],
) -> None:
    gain = "[Path('debug.json').write_text('1.0'), 1.0][1]"
    with ProcessPoolExecutor(1) as pool:
        assert [computed(gain, executor=pool) for _ in range(2)] == 2 * [(1.0, 1)]


def test_workers_tell_what_they_have_read(computed: Callable[..., tuple[float, int]]) -> None:
    gain = 'remembered(at + "/gain")'
    with ProcessPoolExecutor(1) as pool:
        assert [computed(gain, executor=pool), computed(gain)] == 2 * [(1.0, 1)]
        Path("one/gain").write_text("7.0")
        with pytest.warns(UserWarning, match="reader is not kept: .*one.gain has changed since"):
            assert computed(gain, executor=pool) == (1.0, 2)


def test_a_worker_that_reads_another_file_than_the_sender_is_refused(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert computed('remembered(at + "/gain")') == (1.0, 1)
    here, really = threading.get_ident(), cells._held
    monkeypatch.setattr(cells, "_held", lambda file: really(file) if threading.get_ident() == here else "another")
    with (
        ThreadPoolExecutor(1) as pool,
        pytest.raises(InputError, match=r"worker lacks or has another .*one.gain than the sender"),
    ):
        computed('remembered(at + "/gain") + 1.0', executor=pool)


def test_workers_may_stand_in_folders_of_their_own() -> None:
    assert unlike("second", {"file": "held"}, {".": "two", "file": "there"}) == ""
    assert unlike("second", {"file": "held"}, {"file": "other"}).startswith("file has changed before second read it")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_process_that_is_forked_within_a_cell_computes_none() -> None:
    with opened_files.computing([], set()):
        child = get_context("fork").Process(target=lambda: sys.exit(opened_files.computes()))
        child.start()
    child.join()
    assert child.exitcode == 0
