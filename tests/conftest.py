"""What all tests share: the command, run in this process."""

import os
import signal
import sys

import pytest

from hexmj.user_code import opened_files
from reader import computed  # noqa: F401

sys.dont_write_bytecode = False  # what is compiled here a thousand processes use
os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # which keep nothing of sources that a test edits within a second

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as in the background, and so would what tests start
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def a_program_of_its_own():
    """What tests before this one have opened is nothing to it."""
    for known in (opened_files._OPENED, opened_files._DOUBTS, opened_files._AT_FIRST):
        known.clear()


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command in this process: its exit code, standard output and standard error."""
    from hexmj.cli.loaded import LOADED
    from hexmj.cli.main import main

    def call(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["hexmj", *map(str, words)])
        LOADED.clear()
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        return code, *capsys.readouterr()

    yield call
    LOADED.clear()
