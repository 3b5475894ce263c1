"""Debian's Chromium without a screen and without a network, driven by the protocol of its developer tools."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
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
"""Resolve no names, so that only this machine can be reached."""

PATIENCE = 120.0
"""Longest time until an answer [s]."""


class Tab:
    """An open page, its requests and its errors."""

    def __init__(self, socket: Connection, session: str) -> None:
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._socket, self._session, self._asked = socket, session, 0

    def call(self, method: str, **options: Any) -> dict[str, Any]:
        """Call a method of the protocol and record events until its answer."""
        self._asked += 1
        asked = {"id": self._asked, "sessionId": self._session, "method": method, "params": options}
        self._socket.send(json.dumps(asked))
        while True:
            answer = json.loads(self._socket.recv(timeout=PATIENCE))
            if answer.get("id") == self._asked and answer.get("sessionId") == self._session:
                assert "error" not in answer, answer
                return answer["result"]
            self._take(answer.get("method", ""), answer.get("params", {}))

    def _take(self, method: str, answer: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            self.requests.append(answer["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            details = answer["exceptionDetails"]
            self.complaints.append(details.get("exception", details).get("description", details["text"]))
        elif method == "Log.entryAdded":
            self.complaints.append(answer["entry"]["text"])

    def open(self, address: str) -> None:
        """Open an address and wait until it is loaded."""
        self.call("Page.navigate", url=address)
        self.wait("document.readyState === 'complete'")

    def value(self, script: str) -> Any:
        """Return the value of an expression of JavaScript or of its promise."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, script: str, seconds: float = PATIENCE) -> None:
        """Wait until an expression is true."""
        poll = f"""new Promise((done, fail) => {{
            const end = performance.now() + {1000 * seconds};
            const look = () => ({script}) ? done() : performance.now() > end ? fail({script!r}) : setTimeout(look, 20);
            look();
        }})"""
        self.value(poll)

    def resize(self, width: int, height: int) -> None:
        """Set the size of the screen [pixels]."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)

    def press(self, key: str) -> None:
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code="Space" if key == " " else key)


@contextmanager
def tab() -> Iterator[Tab]:
    """Open an empty page in a new Chromium; skip the test if there is none."""
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
                options = {"targetId": target, "flatten": True}
                socket.send(json.dumps({"id": 0, "method": "Target.attachToTarget", "params": options}))
                while "result" not in (answer := json.loads(socket.recv(timeout=PATIENCE))):
                    pass
                opened = Tab(socket, answer["result"]["sessionId"])
                for domain in ("Page", "Runtime", "Network", "Log"):
                    opened.call(f"{domain}.enable")
                yield opened
        finally:
            running.terminate()
            running.wait(PATIENCE)
            if running.stderr:
                running.stderr.close()
