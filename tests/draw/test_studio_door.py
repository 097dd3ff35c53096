"""The page of `smc.view` is for its address alone: other pages, other hosts and uploads get 403
before Studio reads them.
"""

import os
import socket
import subprocess
import sys
import types

import pytest

from smc_mujoco.draw.studio_door import Door

pytestmark = pytest.mark.quick
WORD = "/SECRET"
EVIL = "http://evil.example"


class Headers(dict):
    """Headers as websockets has them: each with a list of values."""

    def get_all(self, name):
        return self.get(name, [])


class Server:
    """A stand-in for Studio's: it notes what reaches it."""

    def __init__(self):
        self.bound = None

    def bind_loopback_socket(self, port):
        return socket.create_server(("127.0.0.1", port))

    def bind_public_socket(self, host, port):
        self.bound = host
        return types.SimpleNamespace(getsockname=lambda: (host, port))

    def serve(self, handler, *, process_request, **options):
        return process_request


@pytest.fixture
def server():
    """Studio's server behind a door on port 8080."""
    return Server()


def asked(server, path, **headers):
    """Return the path that Studio is asked for, or the status of the refusal."""
    door = Door(server)
    assert door.bind("::", 8080) is door.bind("::", 0)  # ours, then Studio's
    door.secret = WORD
    seen = []
    admit = door.serve(None, process_request=lambda connection, request: seen.append(request.path))
    request = types.SimpleNamespace(
        path=path, headers=Headers({"Host": ["127.0.0.1:8080"]} | headers)
    )
    refusals = []
    connection = types.SimpleNamespace(respond=lambda status, words: refusals.append(status))
    admit(connection, request)
    (answer,) = seen or refusals
    return answer


@pytest.mark.parametrize("host", ["::", "0.0.0.0", "192.168.1.7", ""])
def test_studio_serves_this_machine_alone_whatever_it_asks_for(host, server):
    door = Door(server)
    door.bind(host, 8080)
    assert server.bound == "127.0.0.1"
    assert door.address == f"http://127.0.0.1:8080{door.secret}/"


def test_each_view_has_a_word_of_its_own_that_nobody_guesses(server):
    words = {Door(server).secret for _ in range(20)}
    assert len(words) == 20
    assert min(map(len, words)) > 20


@pytest.mark.parametrize("path", ["/", "/web_client.js", "/model?crc32=7", "/state?sid=a", "/ui"])
def test_the_address_opens_all_of_the_page(path, server):
    for host in ("127.0.0.1:8080", "localhost:8080"):
        for origin in ([], [f"http://{host}"]):
            assert asked(server, WORD + path, Host=[host], Origin=origin) == path


@pytest.mark.parametrize("path", ["/", "/web_client.js", "/model", "/state?sid=a", "/ui", "/drop"])
@pytest.mark.parametrize(
    ("word", "headers"),
    [
        ("", {}),
        ("/secret", {}),
        (f"{WORD}X", {}),
        (f"//127.0.0.1:8080{WORD}", {}),
        (f"http://127.0.0.1:8080{WORD}", {}),
        ("/é", {}),
        (WORD, {"Host": ["evil.example:8080"]}),
        (WORD, {"Host": ["127.0.0.1"]}),
        (WORD, {"Host": ["127.0.0.1:8081"]}),
        (WORD, {"Host": []}),
        (WORD, {"Host": ["127.0.0.1:8080", "evil.example"]}),
        (WORD, {"Origin": [EVIL]}),
        (WORD, {"Origin": ["null"]}),
        (WORD, {"Origin": ["http://127.0.0.1:8081"]}),
        (WORD, {"Origin": ["https://127.0.0.1:8080"]}),
        (WORD, {"Origin": ["http://127.0.0.1:8080", EVIL]}),
    ],
)
def test_others_are_refused_before_studio_reads_them(word, headers, path, server):
    assert asked(server, word + path, **headers) == 403


@pytest.mark.parametrize("path", [WORD, f"{WORD}/drop", f"{WORD}/drop?sid=a"])
def test_no_model_is_uploaded(path, server):
    assert asked(server, path) == 403


@pytest.mark.skipif(os.name != "posix", reason="whose a connection is, is asked of /dev/fd")
def test_studio_s_second_port_is_for_this_process_alone(server):
    """Any page could connect to it, and took the place of Studio's own panels."""
    with Door(server).bind_inner() as inner:
        address = inner.getsockname()
        code = f"import socket; print(socket.create_connection({address}).recv(9))"
        with subprocess.Popen([sys.executable, "-SEc", code], stdout=subprocess.PIPE) as stranger:
            with pytest.raises(ConnectionAbortedError):
                inner.accept()
            assert stranger.communicate()[0] == b"b''\n"
        with socket.create_connection(address) as own, inner.accept()[0] as taken:
            assert taken.getpeername() == own.getsockname()
