"""Where the viewer is served: a host and a free port, checked before the server starts."""

import errno
import getpass
import ipaddress
import os
import socket

from twin.foundation.errors import DataError

THIS_MACHINE = "127.0.0.1"
LAST_PORT = 65535


def free_port(host: str, port: int) -> int:
    """Return the first free port of `host` from `port` on.

    Raises DataError for a port outside 1 to 65535 or one that needs more rights, and for a host that is not this machine.
    """
    if not 1 <= port <= LAST_PORT:
        raise DataError(f"port {port}: a port is a number from 1 to {LAST_PORT}; give one with --port")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for candidate in range(port, LAST_PORT + 1):
        try:
            with socket.create_server((host, candidate), family=family):
                return candidate
        except PermissionError:
            raise DataError(f"port {candidate}: you have no permission to serve on it; give one above 1023 with --port") from None
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                words = error.strerror or str(error)
                raise DataError(
                    f"host {host!r}: cannot be served on ({words}); give an address of this machine with --host"
                ) from None
    raise DataError(f"ports {port} to {LAST_PORT} of {host} are all taken; give a lower one with --port")


def is_private(host: str) -> bool:
    """Return whether only this machine reaches `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def opening_words(host: str, port: int) -> list[str]:
    """Return the lines that say how to open the page, from another machine too, and who else can."""
    local = THIS_MACHINE if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    lines = [f"open http://{local}:{port} (Ctrl-C ends it)"]
    if not is_private(host):
        return [*lines, f"warning: --host {host} lets anyone on the network look at this page and move things in it"]
    if "SSH_CONNECTION" in os.environ:
        tunnel = f"ssh -L {port}:localhost:{port} {_user()}@{socket.gethostname()}"
        lines.append(f"from your own machine: {tunnel}, then open http://localhost:{port} there")
    return lines


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a user without an entry in the machine's list
        return "user"
