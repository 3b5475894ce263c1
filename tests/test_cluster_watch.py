"""Whoever waits for a cluster is told that nobody is at work there."""

import threading
from types import MappingProxyType, SimpleNamespace

import pytest

from hexmj.sweep import cluster


def test_it_is_said_that_the_last_worker_has_gone_while_cells_wait(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cluster, "EVERY", 0.01)
    over, seen = threading.Event(), iter([{}, {"a": 1}, {"a": 1}, {}, {}, {"a": 1}, {}])

    class Client:
        futures = MappingProxyType({"cell": SimpleNamespace(status="pending")})

        def nthreads(self) -> dict[str, int]:
            if (now := next(seen, None)) is not None:
                return now
            over.set()
            raise OSError

    cluster._watch(Client(), "tcp://there:1", over)
    said = "hexmj: the scheduler at tcp://there:1 has no workers left; cells wait for new ones\n"
    assert capsys.readouterr().err == 2 * said
