"""What a user's code reads as a cell is computed counts, though no source and no setting names it."""

import json
import os
import shutil
import sqlite3
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import hexmj
from hexmj.errors import InputError
from hexmj.sweeps import Cell, KeptValues, run
from hexmj.user_code import reads
from hexmj.user_code.loaded import importable
from small_cells import BODY

READER = """
import json, os, sqlite3, tempfile
from concurrent.futures import ThreadPoolExecutor
from glob import glob
from pathlib import Path
from threading import Thread

import hexmj
import numpy as np
import xarray as xr

def cell(at):
    with open("calls", "a") as file:
        file.write(".")
    return xr.Dataset({{"gain": {gain}}})

def tried(path):
    try:
        return float(Path(path).read_text())
    except OSError:
        return 0.0

def value(rows, at):
    return rows[:, 0] * float(Path(at, "gain").read_text())
"""


def write_all(gain: str, at: str = "one") -> None:
    """Into every file of the folder."""
    Path(at, "gain").write_text(gain)
    Path(at, "gain.json").write_text(gain)
    np.save(Path(at, "gain.npy"), float(gain))
    np.array([float(gain)]).tofile(Path(at, "gain.bin"))
    Path(at, "gain.db").unlink(missing_ok=True)
    with closing(sqlite3.connect(Path(at, "gain.db"))) as data, data:
        data.executescript(f"create table told (gain); insert into told values ({gain})")
    hexmj.save(xr.Dataset({"gain": float(gain)}), Path(at, "gain.nc"))


@pytest.fixture
def computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[float, int]]:
    """The gain that a cell reads in `at`, by a piece of Python, and how often cells were computed so far."""
    monkeypatch.chdir(tmp_path)
    for at, gain in (("one", "1.0"), ("two", "2.0")):
        (tmp_path / at).mkdir()
        write_all(gain, at)

    def computed(gain: str, at: str = "one", **how: object) -> tuple[float, int]:
        (tmp_path / "reader.py").write_text(READER.format(gain=gain))
        data = run([Cell("reader", importable("reader.py").cell, {"at": at})], Path("kept"), **how)[0]  # pyright: ignore
        return float(data.gain), os.stat("calls").st_size

    return computed


@pytest.mark.parametrize(
    "gain",
    [
        'float(np.load(f"{at}/gain.npy"))',
        'float(Path(at, "gain").read_text())',
        'np.loadtxt(os.path.join(at, "gain"))',
        'float(os.read(os.open(f"{at}/gain".encode(), os.O_RDONLY), 9))',
        'json.loads(Path(max(glob(f"{at}/*.js*"))).read_text())',
        'len(os.listdir(at)) + json.loads(Path(at, "gain" + ".json").read_text())',
        'ThreadPoolExecutor(1).submit(lambda: float(Path(at, "gain").read_text())).result()',
        'eval(compile(Path(at + "/gain").read_bytes(), "<text>", "eval"))',
        'list(ThreadPoolExecutor(1).map(np.loadtxt, [f"{at}/gain"]))[0]',
        'np.memmap(f"{at}/gain.bin", float)[0]',
        '[os.chdir(at), float(Path("gain").read_text()), os.chdir("..")][1]',
        'sqlite3.connect(f"{at}/gain.db").execute("select gain from told").fetchone()[0]',
        'float(hexmj.load(f"{at}/gain.nc").gain)',
    ],
)
def test_what_is_read_counts_and_what_is_kept_stays(computed: Callable[..., tuple[float, int]], gain: str) -> None:
    (first, _), (again, once) = computed(gain), computed(gain)
    assert (again, once) == (first, 1)
    write_all("7.0")
    assert [computed(gain), computed(gain)] == 2 * [(first + 6.0, 2)]
    write_all("1.0")
    assert computed(gain) == (first, 2)
    assert len(list(Path("kept").glob("*.nc"))) == 2


def test_who_looks_through_a_whole_project_finds_no_kept_cells(computed: Callable[..., tuple[float, int]]) -> None:
    assert [computed("len(list(Path().rglob('*.json')))") for _ in range(3)] == 3 * [(2.0, 1)]


@pytest.mark.parametrize("name", ["joins.json", "joins.pth", "joins.zip"])
def test_what_joins_a_folder_counts_unless_it_is_to_be_looked_at(
    computed: Callable[..., tuple[float, int]], name: str
) -> None:
    listed = f"len(glob(f'{{at}}/joins*')) + len(glob(f'{{at}}/{Path(name).suffix}'))"
    assert computed(listed) == (0.0, 1)
    (Path("one") / name).write_text("0")
    assert computed(listed) == (1.0, 2)
    for other in ("notes~", "figure.png", "a cell-0123456789ab.nc", ".hidden", "__pycache__"):
        (Path("one") / other).write_text("no data")
    assert computed(listed) == (1.0, 2)
    (Path("one") / "run 2").mkdir()
    assert computed(listed) == (1.0, 3)


def test_a_file_that_was_missing_counts(computed: Callable[..., tuple[float, int]]) -> None:
    assert computed("tried('new')") == (0.0, 1)
    Path("new").write_text("5.0")
    assert computed("tried('new')") == (5.0, 2)


def test_what_it_writes_itself_and_what_others_read_does_not_count(computed: Callable[..., tuple[float, int]]) -> None:
    scratch = "float(Path('scratch').write_text(str(np.random.random())) and len(Path('scratch').read_text()) > 0)"
    assert [computed(scratch), computed(scratch)] == 2 * [(1.0, 1)]
    text = "def read():\n    with open('one/gain') as file:\n        return xarray.Dataset({'gain': file.read()})"
    Path("other.py").write_text(f"import xarray\n{text}")
    run([Cell("other", importable("other.py").read, {})], Path("others"))
    assert '"one/gain"' in next(Path("others").iterdir()).read_bytes().decode(errors="replace")
    assert computed("2.0") == (2.0, 2)
    Path("one/gain").write_text("7.0")
    assert [computed(scratch), computed("2.0")] == [(1.0, 2), (2.0, 2)]


def test_a_file_that_changes_while_a_cell_reads_it_is_a_sentence(computed: Callable[..., tuple[float, int]]) -> None:
    gain = "[Path(at, 'gain').read_text(), os.system(f'echo 9 > {at}/gain'), float(Path(at, 'gain').read_text())][2]"
    with pytest.raises(InputError, match=r"^reader: one.gain has changed while it was in use; start again$"):
        computed(gain)
    assert not list(Path("kept").iterdir())


@pytest.mark.parametrize(
    "gain",
    [
        "[Path('one/gain').read_text(), Path('one/gain').write_text(str(np.random.random())), 2.0][2]",
        "[hexmj.save(xr.Dataset({'a': np.random.random()}), 'a.nc'), hexmj.load('a.nc'), 2.0][2]",
        "[Path('a').write_text(str(np.random.random())), os.replace('a', 'b'), Path('b').read_text(), 2.0][3]",
        "[(it := tempfile.mkstemp()), os.write(it[0], b'2.0'), os.close(it[0]), float(Path(it[1]).read_text())][3]",
    ],
)
def test_a_memory_that_is_read_and_written_does_not_count(
    computed: Callable[..., tuple[float, int]], gain: str
) -> None:
    assert [computed(gain), computed(gain)] == 2 * [(2.0, 1)]


@pytest.mark.parametrize("read_again", ["", ", np.fromfile('one/gain.bin')"])
def test_what_was_opened_to_be_written_too_and_has_changed_is_believed_no_more(
    computed: Callable[..., tuple[float, int]], read_again: str
) -> None:
    gain = f"[np.memmap('one/gain.bin', float)[0], os.system('printf 12345678 > one/gain.bin'){read_again}][0]"
    with pytest.warns(UserWarning, match=r"^reader: one.gain\.bin was opened to be read and written, and has changed"):
        assert computed(f"float({gain})") == (1.0, 1)
    changed = np.fromfile("one/gain.bin")[0]
    again = "float(np.fromfile('one/gain.bin')[0])"
    assert [computed(again), computed(again)] == [(changed, 2), (changed, 3)]


def test_a_thread_of_nobodys_that_lists_a_folder_does_not_count(computed: Callable[..., tuple[float, int]]) -> None:
    gain = "[(one := Thread(target=os.listdir, args=['one'])).start(), one.join(), 2.0][2]"
    assert computed(gain) == (2.0, 1)
    Path("one/new.json").write_text("")
    assert computed(gain) == (2.0, 1)


def test_what_is_gone_in_the_end_does_not_count(computed: Callable[..., tuple[float, int]]) -> None:
    gain = "[os.system('echo 3.0 > made'), float(Path('made').read_text()), os.remove('made')][1]"
    assert [computed(gain), computed(gain)] == 2 * [(3.0, 1)]


@pytest.mark.parametrize("then", ["is edited", "vanishes", "is left behind"])
def test_what_a_module_remembers_of_a_file_counts_whatever_becomes_of_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, then: str
) -> None:
    (tmp_path / "elsewhere").mkdir()
    text = "GAIN = float(Path('gain').read_text())\ndef cell(): return xr.Dataset({'gain': GAIN})"
    (tmp_path / "remembers.py").write_text(f"import xarray as xr\nfrom pathlib import Path\n{text}")
    for gain in (1.0, 2.0):
        monkeypatch.chdir(tmp_path)
        Path("gain").write_text(str(gain))
        remembers = importable("remembers.py")
        if then == "is edited":
            Path("gain").write_text("3.0")
        elif then == "vanishes":
            Path("gain").unlink()
        else:
            monkeypatch.chdir("elsewhere")
        assert run([Cell("remembers", remembers.cell, {})], tmp_path / "kept")[0].gain == gain
        monkeypatch.delitem(sys.modules, remembers.__name__)


@pytest.mark.parametrize(
    ("before", "gain"),
    [
        ("A = float(Path('gain').read_text())", "A + float(Path('gain').read_text())"),
        ("A = np.memmap('gain.bin', float, 'r')", "A[0]"),
        ("", "mujoco.MjModel.from_xml_path('gain.xml').body_mass[1]"),
    ],
)
def test_what_mixes_what_a_file_held_and_what_it_holds_is_believed_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str, gain: str
) -> None:
    monkeypatch.chdir(tmp_path)
    imports = "import mujoco\nimport numpy as np\nimport xarray as xr\nfrom pathlib import Path"
    Path("mixes.py").write_text(f"{imports}\n{before}\ndef cell():\n    return xr.Dataset({{'gain': {gain}}})")
    for mass, believed in (("1.0", True), ("2.0", False)):
        Path("gain").write_text(mass)
        Path("gain.xml").write_text(BODY.format(mass))
        with open("gain.bin", "r+b" if mass == "2.0" else "wb") as file:
            np.array([float(mass)]).tofile(file)
        cell = Cell("mixes", importable("mixes.py").cell, {})
        run([cell], Path("kept"))
        last = max(Path("kept").iterdir(), key=lambda file: file.stat().st_mtime_ns)
        with xr.open_dataset(last, engine="h5netcdf") as data:
            assert (cell.edited(data.attrs["read"]) == []) == believed


def test_another_current_folder_has_files_of_its_own(computed: Callable[..., tuple[float, int]]) -> None:
    (Path("two") / "one").mkdir()
    write_all("2.0", "two/one")
    gain = 'float(Path("one", "gain").read_text())'
    assert computed(gain) == (1.0, 1)
    for name in ("kept", "calls", "reader.py"):
        os.symlink(os.path.abspath(name), f"two/{name}")
    os.chdir("two")
    assert [computed(gain), computed(gain)] == 2 * [(2.0, 2)]


def test_whoever_else_opens_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("held")
    namespace = {}
    exec(compile(f"with open({str(tmp_path / 'text')!r}) as file: held = file.read()", "/mine.py", "exec"), namespace)
    assert namespace["held"] == "held"


def test_workers_tell_what_they_read(computed: Callable[..., tuple[float, int]]) -> None:
    gain = 'float(Path(at + "/gain").read_text())'
    with ProcessPoolExecutor(1) as pool:
        assert computed(gain, executor=pool) == (1.0, 1)
        Path("one/gain").write_text("7.0")
        assert [computed(gain, executor=pool), computed(gain)] == 2 * [(7.0, 2)]


def test_a_worker_that_remembers_what_has_changed_is_refused(computed: Callable[..., tuple[float, int]]) -> None:
    gain = "globals().get('GAIN') or globals().setdefault('GAIN', float(Path('one/gain').read_text()))"
    with ProcessPoolExecutor(1) as pool:
        assert computed(gain, executor=pool) == (1.0, 1)
        Path("one/gain").write_text("7.0")
        with pytest.raises(
            InputError, match=r"^reader: a worker has read another one.gain than is here; start the workers again"
        ):
            computed(gain, executor=pool)
    with ProcessPoolExecutor(1) as pool:
        assert computed(gain, executor=pool)[0] == 7.0


def test_a_worker_that_remembers_what_its_sender_does_is_not_refused(
    computed: Callable[..., tuple[float, int]],
) -> None:
    gain = "globals().get('OURS') or globals().setdefault('OURS', float(Path('one/gain').read_text()))"
    with ThreadPoolExecutor(1) as threads:
        for calls in (1, 2):
            assert computed(gain, executor=threads) == (1.0, calls)
            Path("one/gain").write_text("7.0")


def test_cells_of_one_run_have_to_have_read_the_same(computed: Callable[..., tuple[float, int]]) -> None:
    computed('float(Path("one", "gain").read_text())')
    cells = [Cell(name, importable("reader.py").cell, {"at": name}) for name in ("first", "second")]
    with pytest.raises(InputError, match=r"^second: .*one.gain has changed while it was in use; start again$"):
        run(cells, Path("both"), progress=lambda _: print(os.system("echo 9 >> one/gain")))
    first, second = run(cells, Path("both"))
    assert first.gain == second.gain != 1.0


def test_a_default_that_is_written_where_a_file_is_gone_is_no_reason_to_believe_more(
    computed: Callable[..., tuple[float, int]],
) -> None:
    gain = "[os.path.exists('own') or Path('own').write_text('2.0'), float(Path('own').read_text())][1]"
    Path("own").write_text("1.0")
    computed(gain)
    cells = [Cell(name, importable("reader.py").cell, {"at": name}) for name in ("first", "second")]
    assert [float(data.gain) for data in run(cells, Path("both"))] == [1.0, 1.0]
    Path("own").unlink()
    assert [float(data.gain) for data in run(cells, Path("both"))] == [2.0, 2.0]


def test_a_copied_project_reads_what_its_code_opens(computed: Callable[..., tuple[float, int]], tmp_path: Path) -> None:
    gain = f"float(Path({str(tmp_path / 'one')!r}, 'gain').read_text())"
    assert computed(gain) == (1.0, 1)
    copy = shutil.copytree(tmp_path, tmp_path / "copy")
    Path("one/gain").write_text("7.0")
    os.chdir(copy)
    assert run([Cell("reader", importable("reader.py").cell, {"at": "one"})], Path("kept"))[0].gain == 7.0


def test_a_large_file_is_not_read_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reads, "LARGE", 1000)
    monkeypatch.chdir(tmp_path)
    text = "with open('large') as file:\n        return xr.Dataset({'gain': file.read(1)})"
    Path("begins.py").write_text(f"import xarray as xr\ndef cell():\n    {text}")
    begins, digests = importable("begins.py"), reads.digest_of
    monkeypatch.setattr(reads, "digest_of", lambda path: read.append(path) or digests(path))
    for letter, kept in (("a", 1), ("a", 1), ("b", 2)):
        Path("large").write_text(letter * 1000)
        read: list[Path] = []
        assert begins.cell().gain == letter and read == []
        assert run([Cell("begins", begins.cell, {})], Path("kept"))[0].gain == letter
        assert len(list(Path("kept").iterdir())) == kept


def test_a_project_that_is_moved_is_believed(computed: Callable[..., tuple[float, int]], tmp_path: Path) -> None:
    gain = 'float(Path(__file__).with_name("one").joinpath("gain").read_text())'
    assert computed(gain, "elsewhere") == (1.0, 1)
    moved = tmp_path / "moved"
    for name in ("one", "kept", "reader.py", "calls"):
        shutil.copytree(name, moved / name) if Path(name).is_dir() else shutil.copy(name, moved / name)
    shutil.rmtree("one")
    os.chdir(moved)
    cells = [Cell(name, importable("reader.py").cell, {"at": "elsewhere"}) for name in ("reader", "one more")]
    assert ([float(data.gain) for data in run(cells, Path("kept"))], os.stat("calls").st_size) == ([1.0, 1.0], 2)


@pytest.mark.parametrize(
    ("path", "moved"), [("/p/data/gain", "/q/data/gain"), ("/p/code/gain", "/q/code/gain"), ("/x/gain", "/x/gain")]
)
def test_places_are_told_from_the_project(path: str, moved: str) -> None:
    assert reads._path(reads.placed(path, [Path("/p/code")]), [Path("/q/code")]) == moved
    assert reads._path(reads.placed("data/gain", [Path("/p/code")]), [Path("/q/code")]) == "data/gain"


def test_kept_values_of_what_has_changed_are_refused(computed: Callable[..., tuple[float, int]]) -> None:
    computed("1.0")
    cell, rows = Cell("values", importable("reader.py").value, {"at": "one"}), np.ones((2, 1))
    for known in (0, 1):
        values = KeptValues(cell, Path("kept"))
        assert values.known == known and values(rows).tolist() == [1.0, 1.0]
    Path("one/gain").write_text("7.0")
    with pytest.raises(
        InputError, match=r"was made of .*one.gain as it was; delete values-.*\.jsonl, and it is made a"
    ):
        KeptValues(cell, Path("kept"))
    Path("one/gain").write_text("1.0")
    assert KeptValues(cell, Path("kept")).known == 1


def test_a_kept_cell_tells_what_it_read(computed: Callable[..., tuple[float, int]]) -> None:
    computed('float(Path(at + "/gain").read_text())', "two")
    (file,) = Path("kept").glob("*.nc")
    with xr.open_dataset(file, engine="h5netcdf") as data:
        assert json.loads(data.attrs["read"]).keys() == {"two/gain"}
