"""What one cell's code has read others may know: of the same program, of workers, of values that a search keeps."""

import os
import shutil
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from hexmj.errors import InputError
from hexmj.sweeps import Cell, KeptValues, cells, finish, run
from hexmj.sweeps.cells import unlike
from hexmj.user_code.loaded import importable
from hexmj.user_code.opened_files import heard, spelled
from reader import READER, another_program, what_was_read, write_all


def test_what_a_cell_that_fails_has_read_is_remembered(computed: Callable[..., tuple[float, int]]) -> None:
    gain = "remembered('one/gain') / (self.file != 'fails')"
    with pytest.raises(ZeroDivisionError):
        computed(gain, "fails")
    assert computed(gain) == (1.0, 2)
    assert what_was_read() == {"one/gain"}


def test_what_a_cell_has_read_that_goes_on_in_another_thread_is_remembered(
    computed: Callable[..., tuple[float, int]],
) -> None:
    computed("1.0")
    Path("reader.py").write_text(
        READER.format(gain="[remembered('one/gain'), __import__('time').sleep(at == 'slow')][0]")
    )
    reader = importable("reader.py").Reader
    with ThreadPoolExecutor(2) as threads:
        run([Cell(at, reader(at).cell, {}) for at in ("slow", "quick")], Path("kept"), executor=threads)
    assert what_was_read("slow*") == what_was_read("quick*") == {"one/gain"}


def test_what_the_main_thread_opens_meanwhile_is_its_own(computed: Callable[..., tuple[float, int]]) -> None:
    computed("1.0")
    Path("reader.py").write_text(READER.format(gain="[tried('one/gain'), __import__('time').sleep(0.2)][0]"))
    reader = importable("reader.py").Reader
    with ThreadPoolExecutor(1) as threads:
        for _ in finish([Cell(at, reader(at).cell, {}) for at in "ab"], Path("kept"), executor=threads):
            Path("two/gain").read_text()
            time.sleep(0.1)
    assert what_was_read("b-*") == {"one/gain"}


def test_a_result_of_a_file_as_it_was_and_as_it_is_is_told(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("reader.py").write_text(READER.format(gain="float(Path('one/gain').read_text())"))

    def cells() -> list[Cell]:
        return [Cell(at, importable("reader.py").Reader(at).cell, {}) for at in ("first", "second")]

    run(cells()[:1], Path("kept"))
    another_program(monkeypatch)
    found = finish(cells(), Path("kept"))
    assert float(next(found)[1].gain) == 1.0
    write_all("7.0")
    with pytest.warns(UserWarning, match="gain has changed before second read it, and after others did: what comes of"):
        next(found)
    another_program(monkeypatch)
    assert [float(data.gain) for data in run(cells(), Path("kept"))] == [7.0, 7.0]


def test_what_a_thread_reads_ahead_of_which_no_function_is_a_user_s_counts(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    with ThreadPoolExecutor(1) as threads:
        threads.submit(np.loadtxt, "one/gain").result()
    assert computed("1.0") == (1.0, 1)
    assert what_was_read() == {"one/gain"}


def test_a_cell_that_uses_values_that_a_search_has_kept_has_read_what_they_have(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    values = "hexmj.sweeps.KeptValues(hexmj.sweeps.Cell('values', Inner().value, {}), Path('values'))"
    for calls in (1, 2):
        assert computed(f"{values}(np.ones((1, 1)))[0].item()") == (1.0, calls)
        assert what_was_read() == {"one/gain"}
        shutil.rmtree("kept")
        another_program(monkeypatch)


def test_controllers_that_share_a_helper_do_not_count_each_other_s_files(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "shared_helper.py").write_text("ZERO = 0.0")
    monkeypatch.syspath_prepend(tmp_path)
    computed("1.0")
    for at in ("one", "two"):
        text = READER.format(gain=f"shared_helper.ZERO + float(Path('{at}/gain').read_text())")
        Path(f"{at}.py").write_text(f"import shared_helper\n{text}")
        reader = importable(f"{at}.py").Reader
        run([Cell(at, reader().cell, {})], Path(f"kept_{at}"))
    shutil.rmtree("kept")
    Path("kept_two").rename("kept")
    assert what_was_read() == {"two/gain"}


def test_what_an_outer_cell_tells_and_the_package_s_own_do_not_count_for_it(
    computed: Callable[..., tuple[float, int]],
) -> None:
    body = "hexmj.sweeps.Cell('body', Inner().of, {'body': hexmj.STICK_INSECT})"
    inner = f"hexmj.sweeps.run([hexmj.sweeps.Cell('inner', Inner(self.file).cell, {{}}), {body}])[0].gain.item()"
    assert computed(inner, "one/gain") == (1.0, 1)
    assert what_was_read() == set()


@pytest.mark.parametrize("file", ["", "one/gain"])
@pytest.mark.parametrize("pool", ["", "Process", "Thread"])
def test_a_cell_that_sweeps_has_read_what_its_cells_have_and_tell(
    computed: Callable[..., tuple[float, int]], pool: str, file: str
) -> None:
    pool = pool and f", executor=__import__('concurrent.futures').futures.{pool}PoolExecutor(1)"
    inner = f"hexmj.sweeps.Cell('inner', Inner({file!r}).cell, {{}})"
    assert computed(f"hexmj.sweeps.run([{inner}]{pool})[0].gain.item()") == (1.0, 1)
    assert what_was_read() == {"one/gain"}


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
        (data,) = run([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)
    assert data.gain == (7.0 if edited else 1.0)
    assert reader.known == 1.0
    assert what_was_read() == {"one/gain"}


def test_a_field_over_something_that_is_computed_once_is_sent(computed: Callable[..., tuple[float, int]]) -> None:
    Path("reader.py").write_text(
        f"{READER.format(gain='self.known')}\n@dataclass(frozen=True)\nclass Known(Reader):\n    known: float = 3.0"
    )
    with ProcessPoolExecutor(1) as pool:
        (data,) = run([Cell("reader", importable("reader.py").Known(known=4.0).cell, {})], Path("kept"), executor=pool)
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
        run([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)
        another_program(monkeypatch)
        Path("one/gain").write_text("7.0")
        reader = importable("reader.py").Reader()
        assert reader.known == 7.0
        with pytest.warns(UserWarning, match="reader is not kept: .*one.gain has changed since"):
            run([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)


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
    gain = f"hexmj.sweeps.run([{inner}], executor={pool})[0].gain.item()"
    for n in (1, 2):  # what it has seen of the first one, the code may remember
        with pytest.warns(UserWarning, match=f"inner is not kept: .*{told}"):
            computed(f"[importable := hexmj.user_code.loaded.importable, {gain}][1]", f"file {n}")
    assert not [*Path("kept").glob("*.nc")]


def test_a_cell_that_goes_on_where_a_cell_elsewhere_has_failed_is_not_kept(
    computed: Callable[..., tuple[float, int]],
) -> None:
    Path("one/gain").write_text("-1.0")
    Path("reader.py").write_text(
        READER.format(gain="0.0 if fails() else 1.0")
        + """
@dataclass(frozen=True)
class Failing:
    def cell(self):
        return Inner().cell() if float(Path("one/gain").read_text()) > 0 else {}

def fails():
    with __import__("concurrent.futures").futures.ProcessPoolExecutor(1) as pool:
        try:
            hexmj.sweeps.run([hexmj.sweeps.Cell("failing", Failing().cell, {})], executor=pool)
        except hexmj.InputError:
            return True
"""
    )
    with pytest.warns(UserWarning, match="a cell that was swept elsewhere has failed"):
        (data,) = run([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
    assert data.gain == 0.0
    assert not [*Path("kept").glob("*.nc")]


def test_what_a_cached_function_has_swept_before_counts(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though it found its cell kept, and opened nothing."""
    Path("reader.py").write_text(
        READER.format(gain="best()")
        + """
@functools.cache
def best():
    return hexmj.sweeps.run([hexmj.sweeps.Cell("inner", Inner().cell, {})], Path("inner"))[0].gain.item()
"""
    )
    for program in range(3):
        if program == 2:
            Path("one/gain").write_text("7.0")
        module = importable("reader.py")
        assert module.best() == (7.0 if program == 2 else 1.0)
        (data,) = run([Cell("reader", module.Reader().cell, {})], Path("kept"))
        assert data.gain == module.best()
        if program == 0:
            shutil.rmtree("kept")
        another_program(monkeypatch)


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
            run([Cell("reader", reader.Reader().cell, {})], Path("kept"), executor=pool)
            another_program(monkeypatch)


def test_a_folder_that_was_looked_for_before_it_was_made_is_no_data_of_a_worker_s(
    computed: Callable[..., tuple[float, int]],
) -> None:
    Path("reader.py").write_text(READER.format(gain="1.0"))
    reader = importable("reader.py")
    assert reader.tried("kept/made") == 0.0
    Path("kept/made").mkdir(parents=True)
    with ProcessPoolExecutor(1) as pool:
        run([Cell("reader", reader.Reader().cell, {})], Path("kept"), executor=pool)
    assert what_was_read() == set()


def test_a_worker_elsewhere_may_have_a_field_s_file_of_its_own(computed: Callable[..., tuple[float, int]]) -> None:
    Path("two/gain.txt").write_text("2.0")
    Path("gain.txt").write_text("2.0")
    Path("reader.py").write_text(READER.format(gain="float(Path(self.file).read_text())"))
    module = importable("reader.py")
    reader = module.Reader(file="gain.txt")
    assert module.tried("gain.txt") == 2.0
    with ProcessPoolExecutor(1, initializer=os.chdir, initargs=("two",)) as pool:
        (data,) = run([Cell("reader", reader.cell, {})], Path("kept"), executor=pool)
    assert data.gain == 2.0
    assert what_was_read() == set()


def test_a_file_is_heard_by_all_its_names(computed: Callable[..., tuple[float, int]]) -> None:
    Path("one/inner/it").write_text("1.0")
    assert heard({spelled("leads/it")}) == set()
    assert Path("one/inner/it").read_text() == "1.0"
    assert heard({spelled("leads/it")}) == {spelled("leads/it")}


def test_a_file_that_a_text_names_counts_whoever_has_opened_it(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here this test, which the code of the cell is handed the array by."""
    np.savetxt("gains.csv", [1.0])
    Path("reader.py").write_text(
        READER.format(gain="float(cached('gains.csv'))") + "cached = functools.cache(np.loadtxt)"
    )
    module = importable("reader.py")
    assert module.cached("gains.csv") == 1.0
    run([Cell("reader", module.Reader().cell, {})], Path("kept"))
    another_program(monkeypatch)
    np.savetxt("gains.csv", [2.0])
    (data,) = run([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
    assert data.gain == 2.0


def test_what_an_inner_cell_has_read_and_is_edited_before_the_outer_one_is_done_is_not_kept(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    inner = "hexmj.sweeps.run([hexmj.sweeps.Cell('inner', Inner().cell, {})], Path('inner'))[0].gain.item()"
    gain = f"[{inner}, Path('edits').exists() and Path('one/gain').write_text('7.0')][0]"
    assert computed(gain) == (1.0, 1)
    another_program(monkeypatch)
    shutil.rmtree("kept")
    Path("edits").touch()
    with pytest.warns(UserWarning, match="reader is not kept: .*one.gain has changed since"):
        assert computed(gain) == (1.0, 2)


def test_what_workers_cells_write_is_no_other_data_in_the_next_sweep(
    computed: Callable[..., tuple[float, int]],
) -> None:
    gain = "[Path('debug.json').write_text('1.0'), 1.0][1]"
    with ProcessPoolExecutor(1) as pool:
        assert [computed(gain, executor=pool) for _ in range(2)] == 2 * [(1.0, 1)]


def test_cells_side_by_side_do_not_answer_for_each_other(computed: Callable[..., tuple[float, int]]) -> None:
    computed("1.0")
    Path("reader.py").write_text(READER.format(gain="[float(Path(at, 'gain').read_text()) for _ in range(200)][0]"))
    reader = importable("reader.py").Reader
    cells = [Cell(at, reader(at, f"{at}/gain").cell, {}) for at in ("one", "two")]
    with ThreadPoolExecutor(2) as threads:
        assert [float(data.gain) for data in run(cells, Path("both"), executor=threads)] == [1.0, 2.0]
    assert len(list(Path("both").glob("*.nc"))) == 2


def test_a_cell_that_takes_a_kept_one_has_read_what_that_has(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    gain = "hexmj.sweeps.run([hexmj.sweeps.Cell('inner', Inner().cell, {})], Path('inner'))[0].gain.item()"
    for calls in (1, 2):
        assert computed(gain) == (1.0, calls)
        assert what_was_read() == {"one/gain"}
        shutil.rmtree("kept")
        another_program(monkeypatch)


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
        pytest.raises(InputError, match=r"worker has another .*one.gain than the sender"),
    ):
        computed('remembered(at + "/gain") + 1.0', executor=pool)


def test_what_values_in_memory_have_opened_is_remembered(computed: Callable[..., tuple[float, int]]) -> None:
    computed("1.0", "one/gain")
    Path("reader.py").write_text(READER.format(gain="remembered('one/gain')"))
    reader = importable("reader.py").Reader()
    KeptValues(Cell("values", reader.value, {}))(np.ones((1, 1)))
    shutil.rmtree("kept")
    run([Cell("reader", reader.cell, {})], Path("kept"))
    assert what_was_read() == {"one/gain"}


def test_values_are_those_of_the_files_that_were_read(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = np.ones((2, 1))
    computed("1.0")
    Path("reader.py").write_text(READER.format(gain="remembered(self.at + '/gain')"))

    def values(gain: float, known: int) -> None:
        found = KeptValues(Cell("values", importable("reader.py").Reader().value, {}), Path("values"))
        assert (found.known, *found(rows)) == (known, gain, gain)

    values(1.0, known=0)
    values(1.0, known=1)
    write_all("7.0")
    with pytest.warns(UserWarning, match="^values is not kept: .*one.gain has changed since"):
        values(1.0, known=0)
    another_program(monkeypatch)
    values(7.0, known=0)
    values(7.0, known=1)
    write_all("1.0")
    another_program(monkeypatch)
    values(1.0, known=1)


def test_values_of_a_file_as_it_was_and_as_it_is_are_told(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("reader.py").write_text(READER.format(gain="float(Path('one/gain').read_text())"))

    def values() -> KeptValues:
        return KeptValues(Cell("values", importable("reader.py").Reader().value, {}), Path("values"))

    values()(np.ones((1, 1)))
    another_program(monkeypatch)
    found = values()
    write_all("7.0")
    with pytest.warns(UserWarning, match="gain has changed before values read it, and after others did"):
        found(np.zeros((1, 1)))


def test_a_file_that_values_were_kept_beside_may_be_opened_later(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("it.json").write_text("1.0")
    Path("reader.py").write_text(READER.format(gain="(tried('it.json') if len(rows) > 1 else 1.0)"))
    for rows in (1, 2):
        found = KeptValues(Cell("values", importable("reader.py").Reader().value, {}), Path("values"))
        assert found(np.full((rows, 1), float(rows))).tolist() == [rows] * rows
        another_program(monkeypatch)


def test_workers_may_stand_in_folders_of_their_own() -> None:
    assert unlike("second", {"file": "held"}, {".": "two", "file": "there"}) == ""
    assert unlike("second", {"file": "held"}, {"file": "other"}).startswith("file has changed before second read it")
