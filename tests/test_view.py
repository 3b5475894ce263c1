"""A live walk or a recording in a browser, and the command."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.request import urlopen

import pytest

from chromium import tab
from hexmj.conditions import Conditions
from hexmj.controllers.cruse1998 import LDVS
from hexmj.controllers.registry import load_controller
from hexmj.errors import InputError
from hexmj.measures.physical import physical_walk
from hexmj.replay.recording import record, save_recording
from hexmj.starts import draw_starts
from hexmj.view.browser import CHART_INTERVAL, BrowserView, check_port, page_server
from hexmj.view.live import LiveWalk
from hexmj.view.session import LiveSession, ticks

STARTS, GRAHAM = draw_starts(8, seed=1), load_controller("graham")


def view_of(*walk: Any) -> BrowserView:
    return BrowserView(LiveSession(LiveWalk(*walk), 0, STARTS.__getitem__), port=0)


@pytest.fixture
def view() -> Iterator[BrowserView]:
    opened = view_of(LDVS, 0.3, STARTS[0])
    yield opened
    opened.server.stop()


def until(view: BrowserView, done: Callable[[], bool]) -> None:
    """Step until a condition holds; viser's threads apply the sliders."""
    end = time.monotonic() + 20.0
    while not done():
        assert time.monotonic() < end
        view.step(0.02)


def test_the_page_is_served_and_its_sliders_change_the_walk(view):
    with urlopen(view.address) as answer:
        assert answer.status == 200
        assert b"<html" in answer.read(1000)
    walk: Any = view.session.walk
    for _ in range(5):
        view.step(0.02)
    assert walk.moment.seconds > 0.09
    view.controls["forward"].value = 0.6
    until(view, lambda: walk.moment.velocity == 0.6)
    view.controls["turn"].value = 0.005
    until(view, lambda: walk.moment.qpos[6] > 0.05)
    view.controls["p1_i"].value = 3.0
    until(view, lambda: walk.controller.weights.p1_i == 3.0)
    seconds, charted = walk.moment.seconds, list(view._recent)
    view.session.speed = 0.0
    view.step(0.02)
    assert list(view._recent) == charted != []
    view.session.speed = 1.0
    view.controls["V_p"].value = 120.0
    until(view, lambda: walk.conditions.vp == 120.0)
    assert walk.moment.seconds < seconds
    assert "margin" in view._readout.content
    assert "<rect" in view._footfall.content


@pytest.mark.parametrize(("controller", "velocity", "vp"), [(LDVS, 0.97, 10.0), (GRAHAM, 0.345, 1000.0)])
def test_sliders_reach_unusual_values_and_only_symmetric_weights_have_some(controller, velocity, vp):
    view = view_of(controller, velocity, STARTS[0], Conditions(vp=vp))
    try:
        assert (view.controls["forward"].value, view.controls["V_p"].value) == (velocity, vp)
        assert ("p1_i" in view.controls) == (controller is LDVS)
    finally:
        view.server.stop()


def test_bad_addresses_and_a_missing_viser_are_errors(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        for host, port in (("127.0.0.1", taken.getsockname()[1]), ("127.0.0.1", -1), ("nonsense.invalid", 0)):
            with pytest.raises(InputError, match="port"):
                check_port(host, port)
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(InputError, match="viser"):
        view_of(LDVS, 0.3, STARTS[0])


def test_a_page_is_served():
    with page_server("<html></html>", "127.0.0.1", 0) as server, ThreadPoolExecutor(1) as thread:
        thread.submit(server.serve_forever)
        try:
            with urlopen(f"http://127.0.0.1:{server.server_port}/") as answer:
                assert answer.read() == b"<html></html>"
        finally:
            server.shutdown()


def test_a_window_without_a_screen_is_an_error(run, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":4321")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    code, _, error = run("view")
    assert (code, error.count("\n")) == (1, 1)
    assert "--browser" in error


@pytest.mark.slow
@pytest.mark.parametrize("recorded", [False, True])
def test_the_command_serves_until_ctrl_c(recorded, tmp_path):
    words = ["view", "--browser", "--port", "0"]
    if recorded:
        measured = physical_walk(STARTS[:1], LDVS, 0.4, 10.0)
        words.append(str(save_recording(record(measured, 0, "a walk"), tmp_path / "recording.nc")))
    command = [sys.executable, "-P", "-m", "hexmj", *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ
    ) as serving:
        assert serving.stdout
        printed = serving.stdout.readline()
        while "http://" not in printed or "Ctrl-C" not in printed:
            printed += serving.stdout.readline()
        with urlopen("http://" + printed.partition("http://")[2].split()[0]) as answer:
            assert b"</html>" in answer.read()
        serving.send_signal(signal.SIGINT)
        assert serving.wait(30) == 130


@pytest.mark.slow
def test_a_browser_shows_the_walk(view):
    """The readout follows the walk at 25 poses a second; nothing comes from elsewhere."""
    view.step(0.02)
    with tab() as opened:
        opened.resize(1280, 800)
        opened.open(view.address)
        opened.wait("document.body.innerText.includes('margin')")
        before = view.session.walk.moment.seconds
        for _ in range(10):
            view.step(0.1)
        assert view.session.walk.moment.seconds > before
        view.session.speed, used = 0.5, time.process_time()
        for n, passed in zip(range(60), ticks(), strict=False):
            view.step(passed, n % CHART_INTERVAL == 0)
        assert time.process_time() - used < 60 / 25  # of one core, for 25 poses a second
        view.step(0.02)
        opened.wait(f"document.body.innerText.includes('{view.session.walk.moment.seconds:.2f} s')")
        assert opened.value("document.querySelectorAll('canvas').length") >= 1
        rows = "[...document.querySelectorAll('svg text')].find((text) => text.textContent === 'R3')"
        opened.wait(f"{rows} && {rows}.getBoundingClientRect().bottom < 800")  # all footfalls without scrolling
        assert all(request.startswith((view.address, "data:", "blob:")) for request in opened.requests)
