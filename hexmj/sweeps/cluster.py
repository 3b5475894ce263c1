"""Cells on a cluster: the workers of a Dask scheduler as an executor, whatever becomes of either."""

import logging
import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import Any

from hexmj.errors import InputError, without_extra
from hexmj.storage.literal import literal

PATIENCE = 10.0
"""How long an answer of the scheduler is waited for [s]."""

EVERY = 2.0
"""How often it is asked whether anybody is at work [s]."""


@contextmanager
def workers_of(address: str) -> Iterator[Executor]:
    """An executor whose tasks are done by the workers of a Dask scheduler; without a worker they wait for one.

    Args:
        address: of the scheduler, such as 'tcp://127.0.0.1:8786'.

    Raises:
        InputError: Dask is not installed, the scheduler cannot be reached, or a cell killed its workers.
    """
    try:
        from distributed import Client, KilledWorker
    except ModuleNotFoundError:
        raise without_extra("dask", "distributed, which a scheduler needs,") from None
    print(f"hexmj: connecting to the scheduler at {literal(address)}", file=sys.stderr, flush=True)
    with _quiet():
        if not _found(address)["workers"]:
            print(f"hexmj: the scheduler at {address} has no workers yet; cells wait for them", file=sys.stderr)
        client, over = Client(address, timeout=PATIENCE, set_as_default=False), Event()
        Thread(target=_watch, args=(client, address, over), daemon=True).start()
        try:
            yield client.get_executor(pure=False)
        except KilledWorker as error:
            raise InputError(
                f"a cell killed {error.allowed_failures + 1} workers, the last one at {error.last_worker.address}; what"
                " is finished is kept: start again, with more memory for each worker if theirs was full"
            ) from None
        finally:
            over.set()
            with suppress(Exception):  # of a scheduler that is gone
                client.close(timeout=PATIENCE)


def _watch(client: Any, address: str, over: Event) -> None:
    """Say so whenever the last worker has gone away while cells wait."""
    some = False
    while not over.wait(EVERY):
        with suppress(Exception):  # of a scheduler that is gone, which the cells tell
            before, some = some, bool(client.nthreads())
            if before and not some and any(one.status == "pending" for one in [*client.futures.values()]):
                print(
                    f"hexmj: the scheduler at {address} has no workers left; cells wait for new ones", file=sys.stderr
                )


def has_given_up(executor: Executor) -> bool:
    """Whether it is of a Dask client that has lost its scheduler for good, and would wait for ever."""
    client: Any = getattr(executor, "_client", None)
    return getattr(client, "status", "") in ("closed", "closing")


def _found(address: str) -> dict[str, Any]:
    """What a scheduler tells of itself; one that does not answer is not waited for, as a client would."""
    import asyncio

    expected = "a scheduler's, such as tcp://127.0.0.1:8786"
    try:
        told = asyncio.run(asyncio.wait_for(_identity(address), PATIENCE))
    except (OSError, TimeoutError):
        raise InputError(
            f"no scheduler answers at {address}; expected the address that `dask scheduler` prints"
        ) from None
    except (TypeError, ValueError) as error:
        reason = f": {error}" if "address" in str(error) else ""  # else it is Python's own
        raise InputError(f"scheduler = {address!r}{reason}; expected an address that is {expected}") from None
    if told.get("type") != "Scheduler":
        raise InputError(f"scheduler = {address!r} is a {told.get('type')}'s address; expected {expected}")
    return told


async def _identity(address: str) -> dict[str, Any]:
    """What a server of Dask tells of itself."""
    from distributed.comm.core import connect
    from distributed.core import send_recv
    from distributed.security import Security

    comm = await connect(address, timeout=PATIENCE, **Security().get_connection_args("client"))
    try:
        told: Any = await send_recv(comm, op="identity")
        return told
    finally:
        comm.abort()


@contextmanager
def _quiet() -> Iterator[None]:
    """While the block runs, what Dask tells at length does not reach the terminal; the sentences here tell it."""
    before = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="distributed")
        logging.disable()
        try:
            yield
        finally:
            logging.disable(before)
