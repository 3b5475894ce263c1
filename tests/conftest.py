"""Fixtures that all tests share."""

import signal
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from tempfile import gettempdir
from types import ModuleType

import pytest

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # in a background job, whose children would ignore Ctrl-C too
    signal.signal(signal.SIGINT, signal.default_int_handler)

from hexmj.rendering import use_egl_without_display

use_egl_without_display()  # before a test imports MuJoCo


collect_ignore = [] if find_spec("dm_control") else ["test_environment.py"]


@pytest.fixture
def dm() -> ModuleType:
    """The dm_env interface; tests of it are skipped without dm_control."""
    pytest.importorskip("dm_control", reason="dm_control needs Python below 3.13")
    from hexmj.environments import dm

    return dm


@pytest.fixture(autouse=True)
def forget_user_modules() -> Iterator[None]:
    """Forget the modules that a test loads from its temporary directory."""
    modules, path = set(sys.modules), list(sys.path)
    yield
    for name in set(sys.modules) - modules:
        if str(getattr(sys.modules[name], "__file__", None)).startswith(gettempdir()):
            del sys.modules[name]
    sys.path[:] = path


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run the command `hexmj` in this process: its exit code, standard output and standard error."""
    from hexmj.cli.main import main

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["hexmj", *map(str, arguments)])
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        output = capsys.readouterr()
        return code, output.out, output.err

    return call
