"""A law from elsewhere comes through one door, and is the law that its own reader makes."""

import ctypes
import functools
import math

import numpy as np
import pytest
from helpers.plants_ab import called

import smc_mujoco as smc
from smc_mujoco.common import fingerprint
from smc_mujoco.control.law import Measurement
from smc_mujoco.exchange.fmu.law_from_fmu import FmuLaw
from smc_mujoco.exchange.policy import File, Policy

RUN = {"plant": "duffing", "duration": 0.2, "u_max": 6.0}
LEAD = (
    [[-100.0]],
    [[1.0]],
    [[-3000.0]],
    [[40.0]],
)


class Adaptive:
    """A law with a gain that grows, which gives N, and which is no function."""

    def __init__(self):
        self.gain = 0.0

    def __call__(self, observation):
        x, v = observation
        self.gain += 0.1 * abs(v + x)
        return -self.gain * math.tanh(v + x)


def same(one, other):
    return np.array_equal(one.x, other.x) and np.array_equal(one.u, other.u)


def run(law, **fields):
    return smc.run(smc.Scenario(law=law, **(RUN | fields)))


def test_a_file_of_c_and_matrices_are_what_their_readers_make(tmp_path):
    (file := tmp_path / "mine.c").write_text(smc.exchange.law_to_c("pid"))
    assert smc.law_from(file) == smc.exchange.law_from_c(file)
    assert smc.law_from(str(file), name="other", gains={}).name == "other"
    assert smc.law_from(LEAD, name="lead") == smc.exchange.law_from_control(LEAD, name="lead")
    assert smc.law_from(LEAD, inputs="error") == smc.exchange.law_from_control(LEAD, inputs="error")


def test_an_fmu_is_what_its_reader_makes(tmp_path):
    pytest.importorskip("fmpy")
    path = smc.exchange.law_to_fmu("pid", tmp_path / "pid.fmu")
    assert smc.law_from(path, name="mine") == smc.exchange.law_from_fmu(path, name="mine")


@pytest.mark.filterwarnings("ignore::smc_mujoco.errors.PlainLoopWarning")
def test_an_action_in_si_units_is_the_fraction_times_u_max():
    def fraction(observation):
        return -0.5 * math.tanh(observation[0])

    def force(observation):
        return 6.0 * fraction(observation)

    assert same(run(smc.law_from(fraction)), run(smc.law_from(fraction, units="u_max")))
    assert same(run(smc.law_from(fraction)), run(smc.law_from(force, units="SI")))
    assert run(smc.law_from(force, units="SI"), u_max=math.inf).failure is None
    assert 'u_max is inf: give u_max, or units="SI"' in str(
        run(smc.law_from(fraction), u_max=math.inf).failure
    )


@pytest.mark.filterwarnings("ignore::smc_mujoco.errors.PlainLoopWarning")
def test_an_object_that_keeps_state_is_fresh_in_each_run():
    law = smc.law_from(Adaptive(), name="mine", units="SI")
    first = run(law)
    second = run(law)
    assert law.name == "mine"
    assert first.failure is None
    assert same(first, second)
    assert np.abs(first.u).max() > 0.1


class Twin:
    """The law `pid` as opensmc writes controllers: of its own error r - x, with its state in the
    object.
    """

    def __init__(self, law, dt, limit):
        self.law = law
        self.dt = dt
        self.limit = limit
        self.memory = np.zeros(law.memory)

    def compute(self, t, x, xref, plant=None, **kwargs):
        e = x[0] - xref[0]
        de = x[1] - xref[1]
        y = Measurement(t, self.dt, *x, e, de, *xref, 0.0, 1.0, limit=self.limit)
        u, s = called(self.law, y, self.memory)
        return u, {"s": s}


@pytest.mark.filterwarnings("ignore::smc_mujoco.errors.PlainLoopWarning")
def test_a_controller_of_opensmc_s_kind_is_a_law_in_one_line():
    where = {"reference": smc.Sine(0.3, 2.0), "plant": "pendulum_network"}
    own = smc.law("pid", kp=20.0, ki=5.0, kd=4.0)
    law = smc.law_from(Twin(own, 1e-3, 6.0))
    first = run(law, **where)
    again = run(law, **where)
    truth = run(own, **where)
    assert law.name == "Twin"
    np.testing.assert_allclose(first.u, truth.u, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(first.s, truth.s, rtol=1e-9, atol=1e-9)
    assert same(first, again)


def test_the_gain_of_an_lqr_is_a_law_in_one_line():
    trace = run(smc.law_from(np.array([[5.0, 2.0]])))  # u = -K x, as control.lqr returns K
    unbounded = -(5.0 * trace.x[:, 0] + 2.0 * trace.v[:, 0])
    np.testing.assert_allclose(trace.u[:, 0], unbounded.clip(-6.0, 6.0), rtol=1e-12, atol=1e-12)
    assert np.abs(unbounded).min() < 6.0


@pytest.mark.parametrize(
    ("source", "options", "said"),
    [
        ("mine.m", {}, r"unknown ending of a law's file '\.m': did you mean '\.fmu'"),
        ("none.c", {}, r"none\.c"),
        (LEAD, {"units": "SI"}, "units are of a policy's action: leave them out"),
        (print, {"units": "V"}, "unknown units 'V': choose from SI, u_max"),
        (None, {}, "give a callable"),
    ],
)
def test_what_makes_no_law_is_refused_in_a_sentence(source, options, said):
    with pytest.raises(smc.ScenarioError, match=said) as refused:
        smc.law_from(source, **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", [np.ones(3), 5, "", b"x", ["a"], {}], ids=repr)
@pytest.mark.parametrize(
    "source", [Adaptive(), LEAD, Twin(smc.law("pid"), 1e-3, 6.0)], ids=("a", "b", "c")
)
def test_a_name_that_is_none_is_refused(source, name, refused):
    refused(lambda: smc.law_from(source, name=name), f"is {name!r}")


def test_a_system_that_is_not_linear_is_refused_with_a_cure_that_works(refused):
    control = pytest.importorskip("control")
    system = control.NonlinearIOSystem(
        lambda t, x, u, p: -x + u, lambda t, x, u, p: x, inputs=1, outputs=1, states=1
    )
    assert "control.linearize(system, x0, u0)" in refused(lambda: smc.law_from(system))
    assert smc.law_from(control.linearize(system, 0.0, 0.0)).name == "linear_controller"


@pytest.mark.quick
@pytest.mark.parametrize(
    "made",
    [
        functools.partial(
            FmuLaw, name="a", inputs=(), outputs=("u",), constants=(), parameters=(), period=None
        ),
        lambda path, digest: Policy(File(path, digest), "a", False, "u_max"),
    ],
    ids=["fmu", "network"],
)
def test_a_law_s_file_counts_by_its_content_and_not_by_its_folder(made, monkeypatch):
    """Two people with one file in two folders get the same bytes of a table."""
    running = "smc_mujoco.exchange.fmu.law_from_fmu._running.by_number"
    monkeypatch.setattr(running, {1: ctypes.c_void_p()})  # which cannot be pickled
    here, elsewhere, changed = (
        made(path=path, digest=digest)
        for path, digest in (("/anna/a.fmu", "1"), ("/bert/a.fmu", "1"), ("/anna/a.fmu", "2"))
    )
    assert here == elsewhere != changed
    assert fingerprint.of(here) == fingerprint.of(elsewhere) != fingerprint.of(changed)
