"""What shows a live walk or a recording: in a browser, on a page that is served, from the command."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from urllib.request import urlopen

import numpy as np
import pytest

from chromium import tab
from hexmj import progress
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS, Cruse1998, Symmetric
from hexmj.controllers.named import load_controller
from hexmj.measures.physical import physical_walk
from hexmj.replay.recording import record, save_recording
from hexmj.starts import draw_starts
from hexmj.view import live
from hexmj.view.browser import BrowserView
from hexmj.view.charts import footfall
from hexmj.view.live import LiveWalk
from hexmj.view.served import page_server
from hexmj.view.session import LiveSession

STARTS = draw_starts(8, seed=1)


def test_the_footfall_diagram_has_a_bar_for_every_swing():
    off = np.zeros((100, 6), dtype=bool)
    off[10:20, 0] = off[40:60, 0] = off[90:, 5] = True
    assert footfall(np.arange(1, 101) / 80, off).count("<rect") == 3


@pytest.fixture
def view() -> Iterator[BrowserView]:
    """A view of a walk at a port of its own."""
    opened = BrowserView(LiveSession(LiveWalk(LDVS, 0.3, STARTS[0]), 0, STARTS.__getitem__), port=0)
    yield opened
    opened.server.stop()


def weight(walk: LiveWalk) -> float:
    """One of the weights that the insect walks by."""
    controller = walk.controller
    assert isinstance(controller, Cruse1998)
    assert isinstance(controller.weights, Symmetric)
    return controller.weights.p1_i


def until(view: BrowserView, done: Callable[[], bool]) -> None:
    """Go on until something is so; what sliders do is done by threads."""
    end = time.monotonic() + 20.0
    while not done():
        assert time.monotonic() < end
        view.step(0.02)


def test_a_page_is_served_the_walk_goes_on_and_sliders_change_it(view):
    with urlopen(view.address) as answer:
        assert answer.status == 200
        assert b"<html" in answer.read(1000)
    walked = view.session.walk
    for _ in range(5):
        view.step(0.02)
    assert walked.moment.seconds > 0.09
    view.controls["V"].value = 0.6
    until(view, lambda: walked.moment.velocity == 0.6)
    view.controls["p1_i"].value = 3.0
    until(view, lambda: weight(walked) == 3.0)
    seconds = walked.moment.seconds
    assert seconds > 0.1
    view.controls["V_p"].value = 120.0
    until(view, lambda: walked.conditions.vp == 120.0)
    assert walked.moment.seconds < seconds
    assert "margin" in view._readout.content


def test_charts_of_a_walk_that_stands_still_stay_as_they_were(view):
    for _ in range(10):
        view.step(0.02)
    charted = list(view._recent)
    view.session.paused = True
    for _ in range(10):
        view.step(0.02)
    assert list(view._recent) == charted != []


@pytest.mark.parametrize(("velocity", "vp"), [(0.97, 10.0), (0.345, 1000.0)])
def test_what_lies_beyond_the_usual_has_sliders_too(velocity, vp):
    walk = LiveWalk(LDVS, velocity, STARTS[0], Conditions(vp=vp))
    view = BrowserView(LiveSession(walk, 0, STARTS.__getitem__), port=0)
    try:
        assert (view.controls["V"].value, view.controls["V_p"].value) == (velocity, vp)
    finally:
        view.server.stop()


def test_weights_of_other_controllers_have_no_sliders():
    opened = BrowserView(
        LiveSession(LiveWalk(load_controller("graham"), 0.4, STARTS[0]), 0, STARTS.__getitem__), port=0
    )
    try:
        assert set(opened.controls) == {"V", "V_p"}
    finally:
        opened.server.stop()


def test_a_taken_port_and_a_missing_viser_are_sentences(run, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(progress, "EVERY", 600.0)
    settle, settled = live.LiveWalk, list[str]()
    monkeypatch.setattr(live, "LiveWalk", lambda *of: settled.append("an insect") or settle(*of))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        code, _, error = run("view", "--browser", "--port", taken.getsockname()[1])
        assert (code, error.count("\n")) == (2, 1)
        assert f"--port {taken.getsockname()[1]} at 127.0.0.1: " in error and "expected a free port" in error
    for words, said in (
        (("--port", -1), "--port -1; expected 1 to 65535, or 0 for any that is free"),
        (("--port", 70000), "--port 70000; expected 1 to 65535"),
        (("--host", "nonsense.invalid"), "--host nonsense.invalid: no such name; expected an address of this machine"),
    ):
        code, _, error = run("view", "--browser", *words)
        assert (code, error.count("\n")) == (2, 1) and error.startswith(f"hexmj: {said}")
    assert not settled
    monkeypatch.setitem(sys.modules, "viser", None)
    code, _, error = run("view", "--browser", "--port", 0)
    assert code == 2 and settled
    assert 'pip install ".[view]"' in error
    code, _, error = run("view", "recording.nc", "--velocity", 0.5)
    assert code == 2
    assert "--velocity was given with a recording" in error


def test_an_address_is_for_the_browser(run, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":4321")
    for option, value in (("port", 0), ("host", "0.0.0.0")):
        code, _, error = run("view", f"--{option}", value)
        assert (code, error) == (
            2,
            f"hexmj: --{option} was given where there is a screen; expected it with --browser\n",
        )


def test_a_screen_that_is_not_there_is_a_sentence(run, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":4321")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    code, _, error = run("view")
    sentence = "hexmj: no observation time can be opened (DISPLAY = :4321); --browser shows it in a browser\n"
    assert (code, error) == (1, sentence)


def test_who_hangs_up_is_no_error(view, caplog):
    port = view.server.get_port()
    for sent in (b"", b"GET / HT", b"nonsense\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", port)) as half_open:
            half_open.sendall(sent)
    with urlopen(view.address) as answer:
        assert answer.status == 200
    view.server.stop()
    assert not caplog.records


def test_a_served_page_is_there_for_who_asks_for_its_head():
    with page_server("<html></html>", "127.0.0.1", 0) as server, ThreadPoolExecutor(1) as thread:
        thread.submit(server.serve_forever)
        try:
            for path, status, size in (("/", 200, 13), ("/elsewhere", 404, 0)):
                with socket.create_connection(("127.0.0.1", server.server_port)) as asked:
                    asked.sendall(f"HEAD {path} HTTP/1.0\r\n\r\n".encode())
                    answer = asked.makefile("rb").read().decode()
                assert answer.startswith(f"HTTP/1.0 {status} ")
                assert answer.endswith(f"Content-Length: {size}\r\n\r\n"), "and no body"
        finally:
            server.shutdown()


@pytest.mark.slow
@pytest.mark.parametrize("recorded", [False, True])
def test_the_command_serves_until_ctrl_c(recorded, tmp_path):
    words = ["view", "--browser", "--port", "0"]
    if recorded:
        measured = physical_walk(STARTS[:1], LDVS, 0.4, 10.0)
        words.append(str(save_recording(record(measured, 0, "a walk"), tmp_path / "recording.nc")))
    command = [sys.executable, "-P", "-m", "hexmj", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ) as going:
        assert going.stdout
        assert going.stderr
        told = going.stdout.readline()
        while "http://" not in told or "Ctrl-C" not in told:
            told += going.stdout.readline()
        address = "http://" + told.partition("http://")[2].split()[0]
        with urlopen(address) as answer:
            assert b"</html>" in answer.read()
        going.send_signal(signal.SIGINT)
        assert going.wait(30) == 130
        assert going.stderr.read() == "hexmj: stopped\n"


@pytest.mark.slow
def test_a_browser_shows_the_walk(view):
    """What it says of the walk changes as the walk goes on; nothing comes from elsewhere."""
    view.step(0.02)
    with tab() as opened:
        opened.resize(640, 480)
        opened.open(view.address)
        opened.wait("document.body.innerText.includes('margin')")
        before = view.session.walk.moment.seconds
        for _ in range(10):
            view.step(0.1)
        assert view.session.walk.moment.seconds > before
        opened.wait(f"document.body.innerText.includes('{view.session.walk.moment.seconds:.2f} s')")
        assert opened.value("document.querySelectorAll('canvas').length") >= 1
        assert all(one.startswith((view.address, "data:", "blob:")) for one in opened.requests)
