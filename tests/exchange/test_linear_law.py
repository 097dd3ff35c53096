"""Linear controllers as laws, against python-control's simulation, and linear models of plants."""

import pickle
from typing import Any

import control
import numpy as np
import pytest
import scipy.signal
from exchange.helpers.compiler import needs_compiler

import smc_mujoco as smc
from smc_mujoco.simulation.prepare import prepare

H = 0.01
tf: Any = control.tf
LINEAR = smc.plant("duffing", beta=0.0)  # x'' = x - 0.2 x' + u
LEAD = tf([12.0, 30.0], [0.02, 1.0])
CONTROLLERS = {
    "first order": LEAD,
    "integrator": tf([12.0, 30.0, 8.0], [0.02, 1.0, 0.0]),
    "resonant": LEAD * tf([1.0, 0.4, 30.0], [1.0, 4.0, 30.0]),
    "two resonances": LEAD * tf([1.0, 0.4, 30.0], [1.0, 4.0, 30.0]) * tf([1, 1, 90], [1, 9, 90]),
    "gain and rate": control.ss([], [], [], [[30.0, 6.0]]),
}


def text(law: Any) -> str:
    return law.function.text


def sampled(K: control.StateSpace) -> control.StateSpace:
    """K by Tustin's rule, of python-control; a gain has no rule."""
    if control.ss(K).nstates:
        return control.sample_system(control.ss(K), H, "tustin")
    return K


@pytest.mark.quick
def test_an_array_of_gains_is_state_feedback_as_lqr_gives_it():
    A = np.array([[0.0, 1.0], [1.0, -0.2]])
    B = np.array([[0.0], [1.0]])
    K = control.lqr(A, B, np.eye(2), np.eye(1))[0]
    law = smc.law_from(K)
    trace = smc.run(
        smc.Scenario(
            plant=LINEAR,
            law=law,
            x0=0.3,
            v0=-0.4,
            duration=1.0,
            u_max=np.inf,
        )
    )
    np.testing.assert_allclose(
        trace.u[:, 0], -(K[0, 0] * trace.x[:, 0] + K[0, 1] * trace.v[:, 0]), rtol=1e-12
    )
    assert smc.law_from(K[0]).function == law.function
    with pytest.raises(smc.ScenarioError, match="K has 2 outputs"):
        smc.law_from(np.eye(2))


@pytest.mark.parametrize(
    ("name", "discrete"),
    [
        ("first order", True),
        ("integrator", False),
        ("two resonances", False),
        ("gain and rate", False),
    ],
)
def test_a_loop_is_that_of_python_control(name, discrete):
    K = CONTROLLERS[name]
    of_error_alone = K.ninputs == 1
    law = smc.exchange.law_from_control(sampled(K) if discrete else K)
    scenario = smc.Scenario(
        plant=LINEAR,
        law=law,
        x0=0.3,
        v0=-0.4,
        duration=3.0,
        control_period=H,
        u_max=np.inf,
        disturbance=(),
    )
    trace = smc.run(scenario)
    G = control.sample_system(smc.design.state_space(LINEAR), H, "zoh")
    Kd = sampled(K)
    x = np.array([0.3, -0.4])
    w = np.zeros(Kd.nstates)
    positions = []
    for _ in trace.t:
        positions.append(x[0])
        e = -x[:1] if of_error_alone else -x
        u = Kd.C @ w + Kd.D @ e
        w, x = Kd.A @ w + Kd.B @ e, G.A @ x + G.B @ u
    assert not prepare(scenario).why_not
    assert np.abs(trace.x[:, 0] - positions).max() < 1e-8


def test_a_step_of_the_reference_is_the_closed_loop_of_forced_response():
    K = CONTROLLERS["integrator"]
    fields = {
        "x0": 0.0,
        "duration": 4.0,
        "control_period": H,
        "u_max": np.inf,
        "reference": smc.Constant(0.2),
    }
    trace = smc.run(smc.Scenario(plant=LINEAR, law=smc.exchange.law_from_control(K), **fields))
    G = control.sample_system(smc.design.state_space(LINEAR), H, "zoh")
    loop = control.feedback(G * sampled(K))
    answer = control.forced_response(loop, trace.t, np.full(len(trace.t), 0.2))
    assert np.abs(trace.x[:, 0] - np.squeeze(answer.outputs)).max() < 1e-8
    assert abs(trace.x[-1, 0] - 0.2) < 0.01


def test_many_inputs_are_read_by_name():
    K = control.ss([], [], [], [[5.0, -30.0, -6.0, 2.0]])
    law = smc.exchange.law_from_control(K, ["r", "x", "v", "ddr"])
    assert "w3 = y.ddr" in text(law)
    trace = smc.run(
        smc.Scenario(
            plant=LINEAR,
            law=law,
            duration=0.1,
            reference=smc.Constant(0.5),
            u_max=np.inf,
        )
    )
    assert np.allclose(trace.u[:, 0], 2.5 - 30.0 * trace.x[:, 0] - 6.0 * trace.v[:, 0], rtol=1e-12)


@needs_compiler
def test_its_c_gives_the_same_bits(tmp_path):
    law: Any = smc.exchange.law_from_control(CONTROLLERS["two resonances"])
    (tmp_path / "law.c").write_text(smc.exchange.law_to_c(law))
    in_c = smc.exchange.law_from_c(tmp_path / "law.c")
    runs = []
    for controller in (law, in_c(), law.template(scale=0.5)):
        runs.append(
            smc.Scenario(
                plant="duffing",
                law=controller,
                duration=1.0,
                u_max=np.inf,
            )
        )
    first, second, half = smc.run(runs)
    assert np.array_equal(first.u, second.u)
    assert half.u[0, 0] == first.u[0, 0] / 2


@pytest.mark.usefixtures("by_mujoco")
def test_it_is_tuned_pickled_and_told_apart():
    law: Any = smc.exchange.law_from_control(LEAD)
    assert pickle.loads(pickle.dumps(law)) == law != smc.exchange.law_from_control(2 * LEAD)
    assert text(pickle.loads(pickle.dumps(law))) == text(law)
    assert (
        0.01
        <= smc.tune("duffing", law.template(scale=0.02), budget=4, searches=1).gains["scale"]
        <= 100.0
    )


def test_systems_of_scipy_and_matrices_are_taken():
    texts = set()
    for K in (
        tf([1.0, 2.0], [1.0, 3.0]),
        scipy.signal.TransferFunction([1.0, 2.0], [1.0, 3.0]),
        (-3.0, 1.0, -1.0, 1.0),
        ([[-3.0]], [1.0], [-1.0], 1.0, None),
    ):
        texts.add(text(smc.exchange.law_from_control(K)))
    assert len(texts) == 1


def test_what_cannot_be_a_law_is_one_sentence(refused):
    wrong = {
        "improper": tf([1, 0], [1]),
        "two outputs": control.rss(2, 2, 1),
        "three inputs": control.rss(2, 1, 3),
        "51 states": control.rss(51, 1, 1),
        "not square": ([[1.0, 2.0]], 1, 1, 0),
        "not finite": (float("nan"), 1, 1, 0),
        "not real": (1j, 1, 1, 0),
        "negative period": (1, 1, 1, 0, -0.1),
        "a name": "pid",
        "three matrices": (1, 1, 1),
    }
    for K in wrong.values():
        refused(lambda K=K: smc.exchange.law_from_control(K), "K")
    refused(lambda: smc.exchange.law_from_control(LEAD, ["y"]), "input", "'y'")
    refused(lambda: smc.exchange.law_from_control(LEAD, name=""), "name", "''")


def test_a_discrete_one_runs_at_its_own_period_only():
    law = smc.exchange.law_from_control(sampled(LEAD))
    with pytest.raises(
        smc.ScenarioError, match=r"is discretised for 0.01 s, and control_period is 0.001 s: give"
    ):
        smc.Scenario(plant="duffing", law=law)
    sampled_lead = sampled(LEAD)
    sampled_lead.dt = True
    smc.Scenario(plant="duffing", law=smc.exchange.law_from_control(sampled_lead))


# the linear model of a plant


@pytest.mark.parametrize("name", [name for name in smc.plants() if not smc.plant(name).pose])
def test_a_and_b_are_the_derivatives_of_the_nominal_model(name):
    """Where it has one for its channels alone, and so holds with the others at rest."""
    plant = smc.plant(name)
    G = smc.design.state_space(plant)
    n = plant.n
    assert G.nstates == 2 * n
    assert G.ninputs == plant.driven
    assert G.noutputs == n
    assert np.array_equal(G.A[:n], np.eye(n, 2 * n, n))
    assert not G.B[:n].any()
    rest = np.array(plant.rest or (0.0,) * n)
    p = smc.plant(name).values({})
    for i in range(plant.driven):
        _, g = plant.nominal(rest, np.zeros(n), i, p)
        assert G.B[n + i, i] == pytest.approx(g, rel=1e-6)


def test_a_body_that_hovers_leans_to_move_and_its_rotors_turn_it():
    plant = smc.plant("quadrotor")
    G = smc.design.state_space(plant)
    p = plant.parameters
    A = np.zeros((12, 12))
    B = np.zeros((12, 4))
    A[:6, 6:] = np.eye(6)
    A[6, 4], A[7, 3] = p["grav"], -p["grav"]
    B[8] = 1.0 / p["m"]
    B[9] = p["a"] / p["Jx"] * np.array([-1, -1, 1, 1])
    B[10] = p["a"] / p["Jy"] * np.array([-1, 1, 1, -1])
    B[11] = p["c"] / p["Jz"] * np.array([-1, 1, -1, 1])
    np.testing.assert_allclose(G.A, A, atol=1e-6)
    np.testing.assert_allclose(G.B, B, rtol=1e-8, atol=1e-6)
    assert list(G.input_labels) == ["u[rotor1]", "u[rotor2]", "u[rotor3]", "u[rotor4]"]
    assert G.state_labels[3] == "x[body_rx]"


def test_it_is_linearised_where_a_command_holds_it():
    G = smc.design.state_space("inverted_pendulum", 0.5)
    assert G.A[1, 0] == pytest.approx(
        smc.design.state_space("inverted_pendulum").A[1, 0] * np.cos(0.5), rel=1e-6
    )
    with pytest.raises(
        smc.ScenarioError,
        match=r"no command holds cart_pole at rest at x = 0\.5, 0\.5: give another",
    ):
        smc.design.state_space("cart_pole", 0.5)


def test_gains_are_taken_as_a_list_as_well_as_an_array(refused):
    as_list, as_array = (smc.law_from(K) for K in ([[1.0, 2.0]], np.array([[1.0, 2.0]])))
    runs = [smc.Scenario(plant="duffing", law=law, duration=0.1) for law in (as_list, as_array)]
    np.testing.assert_array_equal(*(trace.u for trace in smc.run(runs)))
    refused(lambda: smc.law_from([["a", 2.0]]), "K", "TransferFunction")


def test_names_of_inputs_are_a_list(refused):
    refused(lambda: smc.law_from(np.ones((1, 2)), inputs=np.nan), "inputs is nan", "give a list")
