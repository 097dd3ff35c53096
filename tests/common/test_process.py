"""Other processes, Ctrl-C, and classes that are found by what they derive from."""

import os
import signal
import sys
import threading
import time

import pytest

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_signals
from smc_mujoco.common.process import TimedOut, timed
from smc_mujoco.common.registry import Files, discover, modules, subclasses

pytestmark = pytest.mark.quick


def test_a_command_has_no_input_plain_words_and_its_folder(tmp_path):
    code = (
        "import os, sys; print(os.environ['LC_ALL'], os.getcwd(), sys.stdin.read() == ''); "
        "sys.exit('ä\\udc80')"
    )
    done = timed([sys.executable, "-X", "utf8", "-c", code], 20.0, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stdout == f"C {tmp_path} True\n"
    assert done.stderr.endswith("\n")
    quiet = timed([sys.executable, "-c", "print(1)"], 20.0, output=False)
    assert quiet.returncode == 0
    assert quiet.stdout is None
    assert quiet.stderr is None


@pytest.mark.skipif(os.name != "posix", reason="a shell")
def test_a_command_that_does_not_end_is_stopped_with_all_that_it_started(tmp_path):
    started = time.monotonic()
    with pytest.raises(TimedOut):
        timed(["sh", "-c", f"(sleep 0.5; touch {tmp_path / 'late'}) & sleep 300"], 0.1)
    assert time.monotonic() - started < 200.0
    time.sleep(0.7)
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_waits_for_the_end_of_the_block(monkeypatch):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    reached = False
    try:
        with pytest.raises(KeyboardInterrupt):  # noqa: PT012
            with delay_signals():
                signal.raise_signal(signal.SIGINT)
                reached = True
            raise AssertionError("it came to nothing")
        assert reached
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        with delay_signals():
            pass
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        with delay_signals():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_need_no_delay():
    seen = []

    def work():
        with delay_signals():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGINT)]


def test_a_class_comes_before_those_derived_from_it():
    base = type("Base", (), {})
    first = type("First", (base,), {})
    second = type("Second", (base,), {})
    below = type("Below", (first,), {})
    assert subclasses(base) == [first, second, below]


def test_objects_of_a_package_are_found_by_their_names(tmp_path, monkeypatch):
    package = tmp_path / "found_here"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "a.py").write_text(
        "class Named:\n    def __init__(self, name): self.name = name\nz = Named('z')\nn = 3\n"
    )
    (package / "b.py").write_text("from found_here.a import Named\nb, again = Named('b'), None\n")
    monkeypatch.syspath_prepend(tmp_path)
    files = Files("found_here", object)
    assert list(files) == ["a", "b"]
    assert "found_here.a" not in sys.modules
    assert [module.__name__ for module in modules("found_here")] == ["found_here.a", "found_here.b"]
    kind = sys.modules["found_here.a"].Named
    assert [(name, value.name) for name, value in discover("found_here", kind).items()] == [
        ("b", "b"),
        ("z", "z"),
    ]
    assert Files("found_here", kind)["b"].name == "b"
    with pytest.raises(
        ScenarioError, match=r"a\.py has no Named 'a': name the file as what it adds"
    ):
        Files("found_here", kind)["a"]
