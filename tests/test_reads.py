"""What a cell's code reads beyond what the cell's name tells is kept with it: with other files it is another cell."""

import _ctypes
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import hexmj
from hexmj.sweep import Cell, cells, run_cells
from hexmj.user_code import opened_files
from hexmj.user_code.loaded import importable
from reader import READER, another_program, what_was_read, write_all

READS = [
    ("gain.npy", 'float(np.load(f"{at}/gain" + ".npy"))'),
    ("gain", 'float(Path(at, "gain").read_text())'),
    ("gain", 'float(np.loadtxt(os.path.join(at, "gain")))'),
    ("gain", 'float(os.read(os.open(f"{at}/gain".encode(), os.O_RDONLY), 9))'),
    ("gain.json", 'json.loads(Path(max(glob(f"{at}/*.js*"))).read_text())'),
    ("gain", 'ThreadPoolExecutor(1).submit(lambda: float(Path(at, "gain").read_text())).result()'),
    ("gain", 'eval(compile(Path(at + "/gain").read_bytes(), "<text>", "eval"))'),
    ("gain.py", 'runpy.run_path(f"{at}/gain.py")["GAIN"]'),
    ("gain.py", 'float(Path(at, "gain.py").read_text().split()[-1])'),
    ("gain.py", 'ThreadPoolExecutor(1).submit(runpy.run_path, f"{at}/gain.py").result()["GAIN"]'),
    ("gain.bin", 'float(np.memmap(f"{at}/gain.bin", float)[0])'),
    ("gain", '[os.chdir(at), float(Path("gain").read_text()), os.chdir("..")][1]'),
    ("gain.db", 'sqlite3.connect(f"{at}/gain.db").execute("select gain from told").fetchone()[0]'),
    ("gain.db", 'sqlite3.connect(f"file:{at}/gain.db?mode=ro", uri=True).execute("select * from told").fetchone()[0]'),
    (
        "a gain.db",
        'sqlite3.connect(Path(at, "a gain.db").absolute().as_uri(), uri=True)'
        '.execute("select gain from told").fetchone()[0]',
    ),
    ("gain", 'float(Path("leads", "..", "gain").read_text())'),
    ("gain.json", "float(Path('one/gain.json').read_text())"),
    ("gain.nc", 'float(hexmj.load(f"{at}/gain.nc").gain)'),
    ("gain", 'remembered(f"{at}/gain")'),
    ("gain", 'tried(os.path.join(p := os.path.dirname(hexmj.__file__), os.path.relpath(at, p), "gain"))'),
    ("gain", '[it := open(f"{at}/gain", "a+"), it.seek(0), float(it.read()), it.close()][2]'),
]


@pytest.mark.parametrize(("file", "gain"), READS)
def test_what_it_reads_is_kept_with_it(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch, file: str, gain: str
) -> None:
    if file.endswith(".py"):
        for calls in (1, 2):
            with pytest.warns(
                UserWarning, match=r"^reader is not kept: its code opens or runs .*one.gain.py, of which an"
            ):
                assert computed(gain) == (1.0, calls)
        assert not list(Path("kept").iterdir())
    else:
        assert [computed(gain), computed(gain)] == 2 * [(1.0, 1)]
        write_all("7.0")
        another_program(monkeypatch)
        assert [computed(gain), computed(gain)] == 2 * [(7.0, 2)]


@pytest.mark.parametrize(("file", "gain"), READS)
def test_what_a_field_names_counts(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch, file: str, gain: str
) -> None:
    named = f"one/{file}"
    assert [computed(gain, named), computed(gain, named)] == 2 * [(1.0, 1)]
    write_all("7.0")
    another_program(monkeypatch)
    assert [computed(gain, named), computed(gain, named)] == 2 * [(7.0, 2)]
    assert len(list(Path("kept").glob("*.nc"))) == 2


@pytest.mark.parametrize(
    "gain",
    [
        '[it := Path(at, "gain"), gain := float(it.read_text()), it.write_text(str(gain))][1]',
        '[os.replace(at + "/gain", "held"), float(Path("held").read_text()), os.replace("held", at + "/gain")][1]',
        '[it := Path("memo"), it.write_text("1.0"), float(it.read_text()), it.unlink()][2]',
    ],
)
def test_what_it_reads_and_changes_is_not_kept(computed: Callable[..., tuple[float, int]], gain: str) -> None:
    for calls in (1, 2):
        with pytest.warns(UserWarning, match=r"^reader is not kept: .* has changed since it was opened first"):
            assert computed(gain) == (1.0, calls)


@pytest.mark.parametrize(
    ("file", "gain"),
    [
        ("one/gain", '[it := Path(at, "gain"), it.open("a").close(), float(it.read_text())][2]'),
        ("one/gain", 'made_or_read(Path(at, "gain"))'),
        ("a", "[Path('a').write_text('1.0'), float(Path('a').read_text())][1]"),
        ("b", "[Path('a').write_text('1.0'), os.replace('a', 'b'), float(Path('b').read_text())][2]"),
        ("a.nc", "[hexmj.save(xr.Dataset({'a': 1.0}), 'a.nc'), float(hexmj.load('a.nc').a)][1]"),
    ],
)
def test_what_it_reads_counts_whoever_has_written_it(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch, file: str, gain: str
) -> None:
    assert [computed(gain), computed(gain)] == 2 * [(1.0, 1)]
    Path(file).write_text("1.00")
    another_program(monkeypatch)
    assert computed(gain) == (1.0, 2)


def test_what_it_remembers_of_an_earlier_call_is_not_forgotten(computed: Callable[..., tuple[float, int]]) -> None:
    gain = 'remembered(f"{at}/gain")'
    assert computed(gain) == (1.0, 1)
    Path("one/gain").write_text("7.0")
    for calls in (2, 3):
        with pytest.warns(UserWarning, match="one.gain has changed since it was opened first"):
            assert computed(gain) == (1.0, calls)


def test_an_edit_with_its_time_set_back_is_noticed(computed: Callable[..., tuple[float, int]]) -> None:
    gain, before = 'remembered(f"{at}/gain")', os.stat("one/gain")
    assert computed(gain) == (1.0, 1)
    Path("one/gain").write_text("7.0")
    os.utime("one/gain", ns=(before.st_atime_ns, before.st_mtime_ns))
    with pytest.warns(UserWarning, match="one.gain has changed since it was opened first"):
        assert computed(gain) == (1.0, 2)


def test_what_it_remembers_of_a_file_that_a_field_names_is_not_kept_once_that_has_changed(
    computed: Callable[..., tuple[float, int]],
) -> None:
    gain = 'remembered(f"{at}/gain")'
    assert computed(gain, "one/gain") == (1.0, 1)
    Path("one/gain").write_text("7.0")
    with pytest.warns(UserWarning, match=r"^reader is not kept: .*one.gain has changed since it was opened first"):
        assert computed(gain, "one/gain") == (1.0, 2)
    assert len(list(Path("kept").glob("*.nc"))) == 1


@pytest.mark.parametrize("name", ["libm.so.6", "libc.so.6"])
def test_a_library_that_the_system_finds_does_not_count(computed: Callable[..., tuple[float, int]], name: str) -> None:
    gain = f"__import__('ctypes').CDLL({name!r}) and 1.0"
    assert [computed(gain), computed(gain)] == 2 * [(1.0, 1)]


def test_what_a_cell_reads_after_an_inner_sweep_counts(computed: Callable[..., tuple[float, int]]) -> None:
    inner = "hexmj.flss(hexmj.LDVS, 0.5, n_starts=2, observation time=1.0)"
    assert computed(f"[{inner}, float(Path(at, 'gain').read_text())][1]") == (1.0, 1)
    assert what_was_read() == {"one/gain"}


@pytest.mark.parametrize("folder", [".worktrees", ".gains"])
def test_what_is_hidden_counts(computed: Callable[..., tuple[float, int]], folder: str) -> None:
    Path(folder).mkdir()
    Path(folder, "gain").write_text("1.0")
    assert computed(f"float(Path('{folder}/gain').read_text())") == (1.0, 1)
    assert what_was_read() == {f"{folder}/gain"}


def test_a_file_that_is_missing_counts_too(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    for calls, file in ((1, ""), (2, "new")):
        assert [computed("tried('new')", file), computed("tried('new')", file)] == 2 * [(0.0, calls)]
    Path("new").write_text("5.0")
    another_program(monkeypatch)
    assert [computed("tried('new')"), computed("tried('new')", "new")] == [(5.0, 3), (5.0, 4)]


@pytest.mark.parametrize(
    "gain",
    [
        "[Path('a').write_text('1.0'), os.replace('a', 'b'), 1.0][2]",
        "[hexmj.save(xr.Dataset({'a': 1.0}), 'a.nc'), 1.0][1]",
        "[it := open('log', 'a'), it.write('1.0'), it.close(), open('log', 'a').close(), 1.0][4]",
        "[(it := tempfile.mkstemp()), os.write(it[0], b'1.0'), os.close(it[0]), 1.0][3]",
        "[it := tempfile.mkdtemp(), Path(it, 'a').write_text('1.0'), tried(Path(it, 'a')), shutil.rmtree(it)][2]",
        "[it := tempfile.mkstemp()[1], Path(it).write_text('1.0'), tried(it), os.unlink(it)][2]",
        "ThreadPoolExecutor(1).submit(lambda: [it := tempfile.mkstemp()[1], Path(it).write_text('1.0'), tried(it)][2])"
        ".result()",
        "len(list(Path(at).rglob('*.json')))",
        "len(hexmj.load_controller('graham').name) / 6",
        "sqlite3.connect(':memory:').execute('select 1.0').fetchone()[0]",
        "sqlite3.connect('file::memory:?cache=shared', uri=True).execute('select 1.0').fetchone()[0]",
        "sqlite3.connect('file:it?mode=memory', uri=True).execute('select 1.0').fetchone()[0]",
    ],
)
def test_what_it_writes_itself_and_what_is_installed_does_not_count(
    computed: Callable[..., tuple[float, int]], gain: str
) -> None:
    assert [computed(gain), computed(gain)] == 2 * [(1.0, 1)]


def test_whoever_else_opens_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("held")
    namespace = {}
    exec(compile(f"with open({str(tmp_path / 'text')!r}) as file: held = file.read()", "/mine.py", "exec"), namespace)
    assert namespace["held"] == "held"


def test_what_is_opened_as_a_cell_of_the_packages_own_is_computed_does_not_count(
    computed: Callable[..., tuple[float, int]],
) -> None:
    how = {"folder": Path("flss"), "progress": lambda _: Path("one/gain").read_text()}
    hexmj.flss(hexmj.LDVS, [0.5], n_starts=10, **how)  # pyright: ignore[reportArgumentType]
    assert len(list(Path("flss").glob("*.nc"))) == 1


def test_a_file_that_a_text_names_counts_once_it_is_there_and_where_the_program_stands(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    kept = tmp_path / "kept"
    Path("reader.py").write_text(READER.format(gain="tried('gains.toml') if Path('gains.toml').exists() else 0.0"))
    reader = importable("reader.py").Reader

    def gain() -> float:
        return float(run_cells([Cell("reader", reader().cell, {})], kept)[0].gain)

    assert gain() == 0.0
    Path("elsewhere").mkdir()
    Path("elsewhere", "gains.toml").write_text("1.0")
    monkeypatch.chdir("elsewhere")
    assert gain() == 1.0
    monkeypatch.chdir("..")
    assert gain() == 0.0
    Path("gains.toml").write_text("3.0")
    assert gain() == 3.0


def test_a_folder_that_a_cell_makes_and_removes_does_not_count(computed: Callable[..., tuple[float, int]]) -> None:
    gain = "[it := tempfile.mkdtemp(), os.makedirs(it + '/within/it'), shutil.rmtree(it), 1.0][3]"
    assert [computed(gain), computed(gain)] == 2 * [(1.0, 1)]


def test_a_file_that_a_field_names_by_a_link_or_sqlite_reads_is_remembered(
    computed: Callable[..., tuple[float, int]],
) -> None:
    Path("link").symlink_to("one/gain")
    for file, gain, later in (("link", "remembered('link')", "7.0"), ("one/gain.db", dict(READS)["gain.db"], "8.0")):
        computed(gain, file)
        write_all(later)
        with pytest.warns(UserWarning, match="(gain.*|link) has changed since it was opened first"):
            computed(gain, file)
    Path("link").unlink()
    Path("link").symlink_to("two/gain")
    with pytest.warns(UserWarning, match="link has changed since it was opened first"):
        computed("remembered('link')", "link")


def test_what_changes_as_it_is_looked_at_is_not_kept(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cells, "_held", lambda file: str(Path(file).write_text("7.0")))
    with pytest.warns(UserWarning, match=r"one.gain has changed since it was opened first"):
        assert computed("float(Path(at, 'gain').read_text())") == (1.0, 1)


def test_what_is_no_file_is_not_kept_or_believed(computed: Callable[..., tuple[float, int]]) -> None:
    gain = "[it := open('it', 'rb'), float(b'1' + it.read(1).strip(b'\\0 ')), it.close()][1]"
    Path("it").write_text(" ")
    assert [computed(gain), computed(gain)] == 2 * [(1.0, 1)]
    Path("it").unlink()
    Path("it").symlink_to("/dev/full")
    opened_files._AT_FIRST.clear()
    with pytest.warns(UserWarning, match=r"^reader is not kept: .*it is a pipe or a device; expected a file"):
        assert computed(gain) == (1.0, 2)


def test_a_file_that_a_text_names_and_nobody_opens_counts_by_being_there(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    gain = "1.0 + Path('it.csv').exists()"
    assert [computed(gain), computed(gain)] == 2 * [(1.0, 1)]
    for text in ("a", "b"):
        Path("it.csv").write_text(text)
        another_program(monkeypatch)
        assert [computed(gain), computed(gain)] == 2 * [(2.0, 2)]
    Path("it.csv").unlink()
    assert computed(gain) == (1.0, 3)


@pytest.mark.slow
def test_what_packages_open_by_themselves_counts_by_what_it_holds(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    imports = "def read():\n    import polars\n"
    Path("reader.py").write_text(READER.format(gain="float(os.path.getsize('it.csv'))") + imports)
    for text in ("a", "ab"):
        Path("it.csv").write_text(text)
        (data,) = run_cells([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
        assert data.gain == len(text)
        another_program(monkeypatch)


def test_a_log_that_cells_write_does_not_count_if_the_program_looks_at_it(
    computed: Callable[..., tuple[float, int]],
) -> None:
    """Here this test, between two sweeps."""
    Path("logs").symlink_to("one")
    Path("one/it.csv").touch()
    for calls in (1, 2):
        assert computed(f"logged(Path('logs/it.csv').resolve(), '{calls}')") == (1.0, calls)
        assert Path("logs/it.csv").read_text() == "12"[:calls]
    assert len([*Path("kept").glob("*.nc")]) == 2


def test_a_table_that_the_program_appends_to_is_no_log(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("reader.py").write_text(
        READER.format(gain="float(cached('gains.csv').sum())") + "cached = functools.cache(np.loadtxt)"
    )
    for row, total in (("1.0\n", 1.0), ("10.0\n", 11.0)):
        with Path("gains.csv").open("a") as file:
            file.write(row)
        module = importable("reader.py")
        module.cached("gains.csv")
        (data,) = run_cells([Cell("reader", module.Reader().cell, {})], Path("kept"))
        assert data.gain == total
        another_program(monkeypatch)


def test_what_it_makes_and_reads_by_one_handle_counts(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    gain = "[it := open('a gain', 'a+'), it.seek(0), text := it.read() or '1.0', it.close(), float(text)][-1]"
    assert computed(gain) == (1.0, 1)
    Path("a gain").write_text("7.0")
    another_program(monkeypatch)
    assert computed(gain) == (7.0, 2)


def test_sources_that_a_thread_opens_for_nobody_are_no_reason_to_keep_nothing(
    computed: Callable[..., tuple[float, int]],
) -> None:
    """As one that watches them for edits."""
    Path("script.py").write_text("")

    with ThreadPoolExecutor(1) as thread:
        thread.submit(Path("script.py").read_bytes).result()
    assert computed("1.0") == (1.0, 1)
    assert what_was_read() == set()


def test_a_database_that_was_read_at_import_and_has_changed_since_keeps_nothing(
    computed: Callable[..., tuple[float, int]],
) -> None:
    read = dict(READS)["gain.db"].replace("{at}", "one")
    Path("reader.py").write_text(f"{READER.format(gain='GAIN')}\nGAIN = {read}\n")
    reader = importable("reader.py").Reader
    write_all("7.0")
    with pytest.warns(UserWarning, match="one.gain.db has changed since it was opened first"):
        assert float(run_cells([Cell("reader", reader().cell, {})], Path("kept"))[0].gain) == 1.0


def test_what_an_installed_base_opens_counts(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "site-packages").mkdir()
    (tmp_path / "site-packages" / "installed_base.py").write_text(
        "from pathlib import Path\nimport xarray as xr\nclass Base:\n    def cell(self):\n"
        "        from hexmj.sweeps import Cell, run\n"
        "        return run_cells([Cell('inner', self.inner, {})])[0]\n"
        "    def inner(self):\n"
        "        return xr.Dataset({'gain': float(Path(self.table).read_text())})\n"
    )
    monkeypatch.syspath_prepend(tmp_path / "site-packages")
    mine = "from dataclasses import dataclass\nfrom installed_base import Base\n"
    mine += "@dataclass(frozen=True)\nclass Reader(Base):\n    at: str = ''\n    table = 'one/gain'\n"
    Path("reader.py").write_text(mine)
    run_cells([Cell("reader", importable("reader.py").Reader().cell, {})], Path("kept"))
    assert what_was_read() == {"one/gain"}


def test_data_of_an_installed_package_that_a_users_code_reads_counts(
    computed: Callable[..., tuple[float, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """So do those that a thread reads in which nothing of theirs is called; what installed code reads counts by its
    package, as libraries do that others load."""
    (folder := Path(".venv", "site-packages", "my_data")).mkdir(parents=True)
    (folder / "__init__.py").write_text(
        "from pathlib import Path\ndef gain(): return float(Path(__file__).with_name('other').read_text())\n"
    )
    monkeypatch.syspath_prepend(".venv/site-packages")
    gain = 'float(__import__("importlib.resources").resources.files("my_data").joinpath("gain").read_text())'
    gain += " + __import__('my_' + 'data').gain() + float(np.loadtxt('.venv/site-packages/my_data/table'))"
    gain += " + float(ThreadPoolExecutor(1).submit(np.loadtxt, '.venv/site-packages/my_data/aside').result())"
    gain += " + 0 * len(repr(__import__('ctypes').CDLL(str(Path('.venv/site-packages/my_data/with.so').absolute()))))"
    (folder / "with.so").write_bytes(Path(_ctypes.__file__).read_bytes())
    for calls, told in ((1, "1.0"), (2, "2.0")):
        for name in ("gain", "other", "table", "aside"):
            (folder / name).write_text(told)
        assert [computed(gain), computed(gain)] == 2 * [(4 * float(told), calls)]
        another_program(monkeypatch)
    assert what_was_read() == {f".venv/site-packages/my_data/{name}" for name in ("gain", "table", "aside")}
