"""Debian's Chromium without a screen and without a network, driven by the protocol of its developer tools."""

import base64
import json
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from websockets.sync.client import connect
from websockets.sync.connection import Connection

NAMES = ("chromium", "chromium-browser", "google-chrome")

OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-port=0",
)  # fmt: skip

OFF = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
"""No name is found, so nothing but this machine is reached."""

PATIENCE = 120.0
"""How long an answer may take [s]."""


class Tab:
    """A page that is open, with all that it asked for and complained about."""

    def __init__(self, socket: Connection, session: str) -> None:
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._socket, self._session, self._asked = socket, session, 0

    def call(self, method: str, **given: Any) -> dict[str, Any]:
        """Call a method of the protocol, and take in what happened until it answers."""
        self._asked += 1
        asked = {"id": self._asked, "sessionId": self._session, "method": method, "params": given}
        self._socket.send(json.dumps(asked))
        while True:
            told = json.loads(self._socket.recv(timeout=PATIENCE))
            if told.get("id") == self._asked and told.get("sessionId") == self._session:
                assert "error" not in told, told
                return told["result"]
            self._take(told.get("method", ""), told.get("params", {}))

    def _take(self, method: str, told: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            self.requests.append(told["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            details = told["exceptionDetails"]
            self.complaints.append(details.get("exception", details).get("description", details["text"]))
        elif method == "Log.entryAdded":
            self.complaints.append(told["entry"]["text"])

    def open(self, address: str) -> None:
        """Open an address, and wait until it is loaded."""
        self.call("Page.navigate", url=address)
        self.wait("document.readyState === 'complete'")

    def value(self, script: str) -> Any:
        """What an expression of JavaScript, or what it promises, is."""
        told = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def wait(self, script: str, seconds: float = PATIENCE) -> None:
        """Wait until an expression is true."""
        poll = f"""new Promise((done, fail) => {{
            const end = performance.now() + {1000 * seconds};
            const look = () => ({script}) ? done() : performance.now() > end ? fail({script!r}) : setTimeout(look, 20);
            look();
        }})"""
        self.value(poll)

    def resize(self, width: int, height: int, phone: bool = False, dark: bool = False) -> None:
        """Give the page a screen of so many pixels."""
        scale = 2 if phone else 1
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=phone
        )
        self.call("Emulation.setTouchEmulationEnabled", enabled=phone)
        theme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[theme])

    def press(self, key: str) -> None:
        """Press a key and let it go."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code="Space" if key == " " else key)

    def screenshot(self, path: Path) -> Path:
        """What is seen, as PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))
        return path


@contextmanager
def tab() -> Iterator[Tab]:
    """An empty page of a Chromium of its own; the test is skipped where there is none."""
    program = next((found for name in NAMES if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip("needs Chromium: `make browser` installs it")
    with TemporaryDirectory(prefix="hexmj-chromium-", ignore_cleanup_errors=True) as profile:
        words = [program, *OPTIONS, OFF, f"--user-data-dir={profile}", "about:blank"]
        running = subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        try:
            assert running.stderr
            lines = (line for line in running.stderr if line.startswith("DevTools listening on "))
            with connect(next(lines).split()[-1], max_size=None) as socket:
                socket.send(json.dumps({"id": 0, "method": "Target.createTarget", "params": {"url": "about:blank"}}))
                target = json.loads(socket.recv(timeout=PATIENCE))["result"]["targetId"]
                given = {"targetId": target, "flatten": True}
                socket.send(json.dumps({"id": 0, "method": "Target.attachToTarget", "params": given}))
                while "result" not in (told := json.loads(socket.recv(timeout=PATIENCE))):
                    pass
                opened = Tab(socket, told["result"]["sessionId"])
                for domain in ("Page", "Runtime", "Network", "Log"):
                    opened.call(f"{domain}.enable")
                yield opened
        finally:
            running.terminate()
            running.wait(PATIENCE)
            if running.stderr:
                running.stderr.close()
