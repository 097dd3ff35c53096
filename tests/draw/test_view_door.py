"""The page of `smc.view` is for its address alone: other pages and other hosts get 403 before viser
reads them.
"""

import urllib.error
import urllib.request

import pytest

pytest.importorskip("viser")
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import smc_mujoco as smc
from smc_mujoco.draw import view_door
from smc_mujoco.draw.session import Session
from smc_mujoco.draw.view import LiveView

WORD = "/SECRET"
PORT = 8080
EVIL = "http://evil.example"


class Headers(dict):
    """Headers as websockets has them: each with a list of values."""

    def get_all(self, name):
        return self.get(name, [])


def inside(path, **headers):
    """The path behind the door."""
    return view_door.inside(WORD, PORT, path, Headers({"Host": ["127.0.0.1:8080"]} | headers))


@pytest.mark.quick
def test_each_view_has_a_word_of_its_own_that_nobody_guesses():
    words = {view_door.secret_path() for _ in range(20)}
    assert len(words) == 20
    assert min(map(len, words)) > 20


@pytest.mark.parametrize(
    ("path", "rest"), [("/", "/"), ("", "/"), ("/icon.svg", "/icon.svg"), ("?a=1", "/?a=1")]
)
def test_the_address_opens_all_of_the_page(path, rest):
    for host in ("127.0.0.1:8080", "localhost:8080"):
        for origin in ([], [f"http://{host}"]):
            assert inside(WORD + path, Host=[host], Origin=origin) == rest


@pytest.mark.parametrize("path", ["", "/", "/icon.svg"])
@pytest.mark.parametrize(
    ("word", "headers"),
    [
        ("", {}),
        ("/secret", {}),
        (f"{WORD}X", {}),
        (f"/{WORD}", {}),
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
def test_others_are_refused_before_viser_reads_them(word, headers, path):
    assert inside(word + path, **headers) is None


@pytest.fixture(scope="module")
def live():
    """A view of a cart."""
    run = smc.Scenario(plant="duffing", law=smc.law("pid"), duration=0.1)
    live = LiveView(Session([run]), 0)
    yield live
    live.close()


def status(address):
    """The status of what a server answers."""
    try:
        with urllib.request.urlopen(address, timeout=20) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def test_the_page_and_its_socket_answer_at_the_address_alone(live):
    """Without the door, viser answers all of these."""
    outside = live.address.replace(live.address.rpartition("/")[0].rpartition("/")[2], "")
    assert status(live.address) == 200
    assert status(outside) == 403
    protocol = [f"viser-v{pytest.importorskip('viser').__version__}"]
    socket = live.address.replace("http", "ws").rstrip("/")
    with connect(socket, subprotocols=protocol) as own:
        assert own.recv(timeout=20)
    strangers = [(outside.replace("http", "ws"), None), (socket, EVIL)]
    for address, origin in strangers:
        with pytest.raises(InvalidStatus) as refused:
            connect(address, subprotocols=protocol, origin=origin)
        assert refused.value.response.status_code == 403


def test_where_a_processor_draws_the_page_is_less_work(live):
    with urllib.request.urlopen(live.address, timeout=20) as answer:
        page = answer.read().decode()
    assert int(answer.headers["Content-Length"]) == len(page.encode())
    assert page.index("fixedDpr") < page.index("</script>")  # before viser reads the address


def test_a_page_serves_this_machine_alone_and_the_door_is_taken_away(live):
    from websockets.asyncio import server

    assert live.server.get_host() == "127.0.0.1"
    assert server.serve.__module__ == server.__name__
