"""Where the viewer is served: the port is free, the host is this machine's, and the text says who can see the page."""

from __future__ import annotations

import socket
from typing import Any

import pytest

from twin.cli.use.view import View
from twin.foundation.errors import DataError
from twin.viewer import address
from twin.viewer.address import THIS_MACHINE, free_port, opening_words


def test_a_taken_port_gives_the_next_free_one() -> None:
    with socket.create_server((THIS_MACHINE, 0)) as taken:
        port = taken.getsockname()[1]
        found = free_port(THIS_MACHINE, port)
    assert port < found < port + 100


def test_no_free_port_up_to_the_last_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(address, "LAST_PORT", 9)
    monkeypatch.setattr(socket, "create_server", _failing(OSError(98, "Address already in use")))
    with pytest.raises(DataError, match=r"ports 7 to 9 of 127.0.0.1 are all taken; give a lower one with --port"):
        free_port(THIS_MACHINE, 7)


@pytest.mark.parametrize("port", [-1, 0, 65536, 10**6])
def test_a_port_out_of_range_is_refused_before_anything_is_read(port: int) -> None:
    with pytest.raises(DataError, match=f"port {port}: a port is a number from 1 to 65535; give one with --port"):
        View(what=("no such robot",), port=port).run()


def test_a_port_without_permission_and_a_foreign_host_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        DataError, match=r"host '192\.0\.2\.1': cannot be served on .*; give an address of this machine with --host"
    ):
        free_port("192.0.2.1", 8080)
    with pytest.raises(DataError, match=r"host 'no\.such\.host\.invalid': cannot be served on"):
        free_port("no.such.host.invalid", 8080)
    monkeypatch.setattr(socket, "create_server", _failing(PermissionError(13, "Permission denied")))
    with pytest.raises(DataError, match=r"port 80: you have no permission to serve on it; give one above 1023 with --port"):
        free_port(THIS_MACHINE, 80)


def test_on_this_machine_the_text_is_the_address_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SSH_CONNECTION", raising=False)
    for host in ("127.0.0.1", "localhost"):
        assert opening_words(host, 8080) == [f"open http://{host}:8080 (Ctrl-C ends it)"]
    assert opening_words("::1", 8080) == ["open http://[::1]:8080 (Ctrl-C ends it)"]


def test_on_a_remote_machine_the_text_names_the_tunnel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSH_CONNECTION", "198.51.100.7 50000 198.51.100.9 22")
    monkeypatch.setattr(address, "_user", lambda: "user")
    monkeypatch.setattr(socket, "gethostname", lambda: "machine")
    _, tunnel = opening_words(THIS_MACHINE, 8081)
    assert tunnel == ("from your own machine: ssh -L 8081:localhost:8081 user@machine, then open http://localhost:8081 there")


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "lab3"])
def test_a_host_that_others_reach_is_warned_of_in_one_line(host: str) -> None:
    first, warning = opening_words(host, 8080)
    assert first.startswith(f"open http://{'127.0.0.1' if host == '0.0.0.0' else host}:8080")
    assert warning == f"warning: --host {host} lets anyone on the network look at this page and move things in it"


def _failing(error: OSError) -> Any:
    def create_server(*_: object, **__: object) -> None:
        raise error

    return create_server
