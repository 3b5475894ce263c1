"""What one cell's code has read others may know: of the same program, of workers, of values that a search keeps."""

import importlib
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from hexmj.sweep import Cell, CachedValues, finished_cells, run_cells
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
        run_cells([Cell(at, reader(at).cell, {}) for at in ("slow", "quick")], Path("kept"), executor=threads)
    assert what_was_read("slow*") == what_was_read("quick*") == {"one/gain"}


def test_what_the_main_thread_opens_meanwhile_is_its_own(computed: Callable[..., tuple[float, int]]) -> None:
    computed("1.0")
    Path("reader.py").write_text(READER.format(gain="[tried('one/gain'), __import__('time').sleep(0.2)][0]"))
    reader = importable("reader.py").Reader
    with ThreadPoolExecutor(1) as threads:
        for _ in finished_cells([Cell(at, reader(at).cell, {}) for at in "ab"], Path("kept"), executor=threads):
            Path("two/gain").read_text()
            time.sleep(0.1)
    assert what_was_read("b-*") == {"one/gain"}


def test_a_result_of_a_file_as_it_was_and_as_it_is_is_told(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("reader.py").write_text(READER.format(gain="float(Path('one/gain').read_text())"))

    def cells() -> list[Cell]:
        return [Cell(at, importable("reader.py").Reader(at).cell, {}) for at in ("first", "second")]

    run_cells(cells()[:1], Path("kept"))
    another_program(monkeypatch)
    found = finished_cells(cells(), Path("kept"))
    assert float(next(found)[1].gain) == 1.0
    write_all("7.0")
    with pytest.warns(UserWarning, match="gain has changed before second read it, and after others did: what comes of"):
        next(found)
    another_program(monkeypatch)
    assert [float(data.gain) for data in run_cells(cells(), Path("kept"))] == [7.0, 7.0]


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
    values = "hexmj.sweeps.CachedValues(hexmj.sweeps.Cell('values', Inner().value, {}), Path('values'))"
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
        run_cells([Cell(at, reader().cell, {})], Path(f"kept_{at}"))
    shutil.rmtree("kept")
    Path("kept_two").rename("kept")
    assert what_was_read() == {"two/gain"}


def test_what_an_outer_cell_tells_and_the_package_s_own_do_not_count_for_it(
    computed: Callable[..., tuple[float, int]],
) -> None:
    body = "hexmj.sweeps.Cell('body', Inner().of, {'body': hexmj.STICK_INSECT})"
    inner = f"hexmj.sweep.run_cells([hexmj.sweeps.Cell('inner', Inner(self.file).cell, {{}}), {body}])[0].gain.item()"
    assert computed(inner, "one/gain") == (1.0, 1)
    assert what_was_read() == set()


@pytest.mark.parametrize("file", ["", "one/gain"])
@pytest.mark.parametrize("pool", ["", "Process", "Thread"])
def test_a_cell_that_sweeps_has_read_what_its_cells_have_and_tell(
    computed: Callable[..., tuple[float, int]], pool: str, file: str
) -> None:
    pool = pool and f", executor=__import__('concurrent.futures').futures.{pool}PoolExecutor(1)"
    inner = f"hexmj.sweeps.Cell('inner', Inner({file!r}).cell, {{}})"
    assert computed(f"hexmj.sweep.run_cells([{inner}]{pool})[0].gain.item()") == (1.0, 1)
    assert what_was_read() == {"one/gain"}


@pytest.mark.parametrize("how", ["swept()", "ThreadPoolExecutor(1).submit(swept).result()"])
@pytest.mark.parametrize("gain", [1.0, -1.0])
@pytest.mark.usefixtures("computed")
def test_what_a_cell_tells_counts_for_one_that_sweeps_it_in_a_thread_or_goes_on_where_it_failed(
    how: str, gain: float
) -> None:
    Path("one/gain").write_text(str(gain))
    Path("reader.py").write_text(
        READER.format(gain=how)
        + """
@dataclass(frozen=True)
class Picky:
    file: str
    def cell(self):
        return xr.Dataset({"gain": gain}) if (gain := float(Path(self.file).read_text())) > 0 else {}

def swept():
    try:
        return hexmj.sweep.run_cells([hexmj.sweeps.Cell("picky", Picky("one/gain").cell, {})])[0].gain.item()
    except hexmj.InputError:
        return 0.0
"""
    )
    (data,) = run_cells([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
    assert data.gain == max(gain, 0.0)
    assert what_was_read() == {"one/gain"}


@pytest.mark.parametrize("kind", ["Path", "str"])
@pytest.mark.parametrize("pool", ["", "Process", "Thread"])
@pytest.mark.usefixtures("computed")
def test_a_file_that_a_swept_cell_missed_counts_for_the_outer_one(
    monkeypatch: pytest.MonkeyPatch, pool: str, kind: str
) -> None:
    pool = pool and f", executor=__import__('concurrent.futures').futures.{pool}PoolExecutor(1)"
    inner = "hexmj.sweeps.Cell('inner', Missing().cell, {})"
    Path("reader.py").write_text(
        READER.format(gain=f"hexmj.sweep.run_cells([{inner}]{pool})[0].gain.item()")
        + f"""
@dataclass(frozen=True)
class Missing:
    file: {kind} = {kind}("two/late")
    def cell(self):
        return xr.Dataset({{"gain": tried(self.file)}})
"""
    )
    for gain in (0.0, 5.0):
        (data,) = run_cells([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
        assert data.gain == gain
        another_program(monkeypatch)
        Path("two/late").write_text("5.0")


@pytest.mark.slow
@pytest.mark.parametrize("at_import", [False, True])
@pytest.mark.usefixtures("computed")
def test_what_an_installed_controller_reads_is_kept_with_it(monkeypatch: pytest.MonkeyPatch, at_import: bool) -> None:
    Path("site-packages").mkdir()
    gain = "float(Path('one/gain').read_text())"
    text = f"{READER.format(gain='GAIN')}\nGAIN = {gain}" if at_import else READER.format(gain=gain)
    name = f"my_reader_{at_import}"
    Path(f"site-packages/{name}.py").write_text(text)
    monkeypatch.syspath_prepend("site-packages")
    (data,) = run_cells([Cell("reader", importlib.import_module(name).Reader().cell, {})], Path("kept"))
    assert data.gain == 1.0
    assert what_was_read() == {"one/gain"}


@pytest.mark.usefixtures("computed")
def test_a_sweep_in_threads_that_begins_in_a_thread_keeps_what_it_may() -> None:
    """It serves no cell: those that its own threads compute are none that it works for."""
    Path("reader.py").write_text(READER.format(gain="[tried('one/gain'), __import__('time').sleep(0.3)][0]"))
    Path("bad_reader.py").write_text(READER.format(gain="runpy.run_path(f'{at}/gain.py')['GAIN']"))
    cells = [
        Cell("bad", importable("bad_reader.py").Reader().cell, {}),
        *(Cell(f"good{n}", importable("reader.py").Reader(file=f"file {n}").cell, {}) for n in range(3)),
    ]
    told = pytest.warns(UserWarning, match="bad is not kept: its code opens or runs")
    with ThreadPoolExecutor(1) as aside, ThreadPoolExecutor(2) as workers, told:
        aside.submit(run, cells, Path("kept"), executor=workers).result()
    assert len([*Path("kept").glob("good*.nc")]) == 3


def test_what_a_cached_function_has_swept_before_counts(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though it found its cell kept, and opened nothing."""
    Path("reader.py").write_text(
        READER.format(gain="best()")
        + """
@functools.cache
def best():
    return hexmj.sweep.run_cells([hexmj.sweeps.Cell("inner", Inner().cell, {})], Path("inner"))[0].gain.item()
"""
    )
    for program in range(3):
        if program == 2:
            Path("one/gain").write_text("7.0")
        module = importable("reader.py")
        assert module.best() == (7.0 if program == 2 else 1.0)
        (data,) = run_cells([Cell("reader", module.Reader().cell, {})], Path("kept"))
        assert data.gain == module.best()
        if program == 0:
            shutil.rmtree("kept")
        another_program(monkeypatch)


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
    run_cells([Cell("reader", module.Reader().cell, {})], Path("kept"))
    another_program(monkeypatch)
    np.savetxt("gains.csv", [2.0])
    (data,) = run_cells([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
    assert data.gain == 2.0


def test_what_an_inner_cell_has_read_and_is_edited_before_the_outer_one_is_done_is_not_kept(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    inner = "hexmj.sweep.run_cells([hexmj.sweeps.Cell('inner', Inner().cell, {})], Path('inner'))[0].gain.item()"
    gain = f"[{inner}, Path('edits').exists() and Path('one/gain').write_text('7.0')][0]"
    assert computed(gain) == (1.0, 1)
    another_program(monkeypatch)
    shutil.rmtree("kept")
    Path("edits").touch()
    with pytest.warns(UserWarning, match="reader is not kept: .*one.gain has changed since"):
        assert computed(gain) == (1.0, 2)


def test_cells_side_by_side_do_not_answer_for_each_other(computed: Callable[..., tuple[float, int]]) -> None:
    computed("1.0")
    Path("reader.py").write_text(READER.format(gain="[float(Path(at, 'gain').read_text()) for _ in range(200)][0]"))
    reader = importable("reader.py").Reader
    cells = [Cell(at, reader(at, f"{at}/gain").cell, {}) for at in ("one", "two")]
    with ThreadPoolExecutor(2) as threads:
        assert [float(data.gain) for data in run_cells(cells, Path("both"), executor=threads)] == [1.0, 2.0]
    assert len(list(Path("both").glob("*.nc"))) == 2


def test_a_cell_that_takes_a_kept_one_has_read_what_that_has(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    gain = "hexmj.sweep.run_cells([hexmj.sweeps.Cell('inner', Inner().cell, {})], Path('inner'))[0].gain.item()"
    for calls in (1, 2):
        assert computed(gain) == (1.0, calls)
        assert what_was_read() == {"one/gain"}
        shutil.rmtree("kept")
        another_program(monkeypatch)


def test_what_values_in_memory_have_opened_is_remembered(computed: Callable[..., tuple[float, int]]) -> None:
    computed("1.0", "one/gain")
    Path("reader.py").write_text(READER.format(gain="remembered('one/gain')"))
    reader = importable("reader.py").Reader()
    CachedValues(Cell("values", reader.value, {}))(np.ones((1, 1)))
    shutil.rmtree("kept")
    run_cells([Cell("reader", reader.cell, {})], Path("kept"))
    assert what_was_read() == {"one/gain"}


def test_values_are_those_of_the_files_that_were_read(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = np.ones((2, 1))
    computed("1.0")
    Path("reader.py").write_text(READER.format(gain="remembered(self.at + '/gain')"))

    def values(gain: float, known: int) -> None:
        found = CachedValues(Cell("values", importable("reader.py").Reader().value, {}), Path("values"))
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

    def values() -> CachedValues:
        return CachedValues(Cell("values", importable("reader.py").Reader().value, {}), Path("values"))

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
        found = CachedValues(Cell("values", importable("reader.py").Reader().value, {}), Path("values"))
        assert found(np.full((rows, 1), float(rows))).tolist() == [rows] * rows
        another_program(monkeypatch)
