"""Where servers listen."""

import socket

from hexmj.errors import InputError

MOST_PORT = 65535


def check_port(host: str, port: int) -> None:
    """Refuse an address that cannot be listened at.

    Raises:
        InputError: it is taken, or none of this machine's.
    """
    if not 0 <= port <= MOST_PORT:
        raise InputError(f"--port {port}; expected 1 to {MOST_PORT}, or 0 for any that is free")
    try:
        socket.getaddrinfo(host, None)
        socket.create_server((host, 0)).close()
    except (OSError, UnicodeError) as error:
        unknown = isinstance(error, socket.gaierror | UnicodeError)
        raise InputError(
            f"--host {host}: {'no such name' if unknown else error.strerror}; expected an address of this"
            " machine, such as 127.0.0.1, or 0.0.0.0 for all of them"
        ) from None
    try:
        socket.create_server((host, port)).close()
    except OSError as error:
        raise InputError(f"--port {port} at {host}: {error.strerror}; expected a free port, or 0 for any") from None
