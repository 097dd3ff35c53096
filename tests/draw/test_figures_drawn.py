"""Every kind of figure of made-up data, recorded with its places, sizes, colours and words."""

import dataclasses
import math

import numpy as np
import pytest
from helpers import arms
from helpers.sketch import failed, made, sketch
from matplotlib.figure import Figure

import smc_mujoco as smc
from smc_mujoco.analysis.chattering import Chattering
from smc_mujoco.analysis.region_of_attraction import CONVERGES, DOES_NOT, UNDECIDED, Basin
from smc_mujoco.analysis.step_halving import StepChange
from smc_mujoco.draw import amplitudes, region
from smc_mujoco.draw.figure import figure, signals
from smc_mujoco.draw.nyquist import nyquist
from smc_mujoco.draw.pareto import pareto
from smc_mujoco.evidence.accuracy.orders import orders
from smc_mujoco.evidence.accuracy.scaling import Accuracy, Scaling
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.simulation.trace import PLANT_DIVERGED

SINE = smc.Sine(0.3, 4.0)
ALL = ("x", "error", "spread", "v", "u", "delivered", "reaction", "d", "s", "channels", "phase", "settling", "end")


def switching(trace: smc.Trace, size: float) -> smc.Trace:
    """The trace with a control that switches at irregular samples around its mean."""
    signs = np.where(np.arange(len(trace.t)) * 7 % 11 % 3 % 2, 1.0, -1.0)
    return dataclasses.replace(trace, u=trace.u + size * signs[:, None])


def duffing(law: str, **fields) -> smc.Trace:
    return made(smc.Scenario(plant="duffing", law=law, **{"duration": 1.2} | fields))


def test_a_figure_of_a_machine_with_friction_a_gear_a_jump_and_a_failure(snapshot):
    parts = {"friction": Coulomb(0.4), "actuator": smc.Backlash(0.04), "reference": SINE}
    jumping = duffing("classical", jump=smc.Jump(0.5, {"mass": 2.0}), **parts)
    lost = failed(duffing("adaptive", **parts), 700, f"{PLANT_DIVERGED}, at t = 0.7 s")
    rests = dataclasses.replace(jumping, v=np.where(jumping.t < 0.8, 1.0, 0.0)[:, None] * jumping.v)
    traces = [switching(rests, 1.0), switching(duffing("super_twisting", **parts), 0.7), lost]
    assert sketch(figure(traces)) == snapshot


def test_a_figure_of_a_network_under_two_laws(snapshot):
    plant = smc.plant("pendulum_network", n=11)
    traces = [made(smc.Scenario(plant=plant, law=law, duration=0.3)) for law in ("classical", "adaptive")]
    assert sketch(figure(traces, title="Pendulums", size=(9.0, 6.0))) == snapshot


def test_a_column_of_every_panel_of_a_cart_with_a_pole(snapshot):
    law = smc.law("classical")
    trace = made(smc.Scenario(plant="cart_pole", law=law, duration=0.4, contact="none", friction=Coulomb(0.01)))
    small = dataclasses.replace(trace, x=0.01 * trace.x, u=0.02 * trace.u)
    assert sketch(figure(small, size="ieee-column", panels=ALL, labels=["small"])) == snapshot


@pytest.mark.parametrize("size", [None, (4.0, 7.0)])
def test_an_arm_of_which_one_run_is_far_off_and_one_is_hit(size, snapshot):
    hit = made(smc.Scenario(plant=arms.arm(), law=smc.law("none"), reference=SINE, duration=0.3))
    push = smc.Push("hand", y=30.0, z=40.0, time=0.1, width=0.02)
    hit = dataclasses.replace(hit, scenario=dataclasses.replace(hit.scenario, disturbance=push))
    far = dataclasses.replace(hit, x=hit.r + 50.0 * (hit.x - hit.r))
    same = dataclasses.replace(hit, x=hit.x + 1e-4)
    assert sketch(figure([hit, far, same], labels=["near", "far", "same"], size=size)) == snapshot


def test_signals_of_two_laws_under_two_conditions(snapshot):
    calm = [duffing("classical"), switching(duffing("super_twisting"), 0.7)]
    jump = [
        dataclasses.replace(one, scenario=dataclasses.replace(one.scenario, jump=smc.Jump(0.4, {"mass": 2.0})))
        for one in calm
    ]
    jump[1] = failed(jump[1], 300, "the law raised ValueError: no")
    page = signals(
        {"calm": dict(zip("ab", calm, strict=True)), "heavier": dict(zip("ab", jump, strict=True))}, None, "Duffing"
    )
    assert "\n".join(map(sketch, page.subfigs)) == snapshot


def test_amplitudes_of_two_laws_that_are_equal_at_one_lag(monkeypatch, snapshot):
    lags = (0.002, 0.01, 0.05)
    laws = {"relay": ("classical", 3.0, 1.0), "smooth": ("super_twisting", 60.0, 2.0)}
    sizes = {}
    runs = {f"{tau:g} s": {} for tau in lags}
    for label, (law, factor, power) in laws.items():
        for tau in lags:
            trace = duffing(law, actuator=smc.Lag(tau), duration=0.01)
            sizes[id(trace.scenario)] = sizes[id(trace)] = factor * tau**power
            runs[f"{tau:g} s"][label] = trace
    changes = [StepChange(0.05, 0.0), StepChange(0.2, 0.0), StepChange(0.0, 0.01)]
    monkeypatch.setattr(amplitudes, "predict", lambda one, ranges: Chattering(amplitude=sizes[id(one)], frequency=1.0))
    monkeypatch.setattr(amplitudes, "channel_cycle", lambda trace: (1.1 * sizes[id(trace)], 3.0))
    monkeypatch.setattr(amplitudes, "step_halving", lambda traces, channel: changes)
    assert sketch(amplitudes.amplitudes(runs)) == snapshot


def test_harmonic_balance_and_the_last_periods_of_a_run(snapshot):
    scenarios = [
        smc.Scenario(plant="duffing", law=law, actuator=smc.Lag(0.01), duration=1.2)
        for law in ("super_twisting", "observer_free")
    ]
    cycle = Chattering(amplitude=0.2, amplitude_x=0.01, frequency=8.0, response=complex(-0.02, 0.003))
    changes = [StepChange(0.11, 0.0), StepChange(0.09, 0.05)]
    page = nyquist(scenarios, 0, [cycle, Chattering()], [made(one) for one in scenarios], changes)
    assert sketch(page) == snapshot


def accuracy(law: str, plant: str = "duffing", order: float = 1.9, theory: float | None = 2.0) -> Accuracy:
    """Errors of two starts that fall with a power of the period; the longest period is not in the fit."""
    periods = (4e-3, 2e-3, 1e-3, 5e-4)
    errors = tuple(tuple(start * (1e3 * h) ** 2 for h in periods) for start in (0.3, 0.5))
    scaling = Scaling(errors=errors, used=periods[1:], order=order, low=1.8, high=2.1, theory=theory, why="")
    names = {"plant": plant, "condition": "slow_noise", "law": law, "gains": "shipped", "unit": "m"}
    return Accuracy(**names, periods=periods, e=scaling, s=scaling, runs=8, failed=0, floor=1e-9)


@pytest.mark.parametrize("size", [None, "ieee-column"])
def test_orders_of_laws_with_and_without_a_theory(size, snapshot):
    rows = [accuracy("super_twisting"), accuracy("classical", theory=None), accuracy("adaptive", order=math.nan)]
    page = orders(rows if size else [rows[0], accuracy("super_twisting", "van_der_pol")], size=size)
    assert sketch(page) == snapshot


@pytest.mark.parametrize("size", [None, (4.0, 6.0)])
def test_maps_of_states_that_converge_early_or_late_or_not(size, snapshot):
    outcome = np.array([[CONVERGES, CONVERGES, DOES_NOT], [CONVERGES, UNDECIDED, DOES_NOT]], np.int8)
    decided = np.array([[2.0, 4.0, 8.0], [8.0, 16.0, 1.0]])
    names = {"plant": "van_der_pol", "unit": "m", "duration": 16.0, "outcome": outcome, "decided_at": decided}
    grid = {"x": np.array([-1.0, 0.0, 2.0]), "v": np.array([-3.0, 3.0])}
    maps = [Basin(law="classical", source="tuned", **names, **grid), Basin(law="adaptive", **names, **grid)]
    assert sketch(region.draw(maps, size=size)) == snapshot


def test_equal_blues_of_maps_side_by_side_are_equal_times():
    names = {"law": "classical", "plant": "van_der_pol", "unit": "m", "duration": 8.0, "x": np.ones(2), "v": np.ones(2)}
    outcome = np.full((2, 2), CONVERGES, np.int8)
    maps = [Basin(**names, outcome=outcome, decided_at=np.full((2, 2), time)) for time in (2.0, 8.0)]
    shades = [ax.collections[0].get_array() for ax in region.draw(maps).axes]
    assert [np.unique(shade).tolist() for shade in shades] == [[0], [1]]


ONE, OTHER = (made(smc.Scenario(plant=name, law="classical", duration=0.01)) for name in ("duffing", "van_der_pol"))
REFUSED = {  # call -> arguments, and what replaces them
    figure: ({"traces": ONE}, [
        {"traces": []}, {"traces": [ONE, OTHER]}, {"labels": ["a", "b"]}, {"labels": "a"},
        {"path": ""}, {"path": "a\0"}, {"path": "a.gif"}, {"path": "a.png", "format": "svg"}, {"format": "svg"},
        {"path": "a", "format": "gif"}, {"size": (1.9, 5.0)}, {"size": (5.0, 101.0)}, {"size": "ieee"}, {"size": 3.0},
        {"panels": ["y"]}, {"panels": []}, {"size": (5.0,)}, {"size": (5.0, 4.0), "fig": Figure()},
        {"format": 10**5000},
    ]),
    orders: ({"rows": []}, [{}]),
    region.draw: ({"maps": []}, [{}]),
    pareto: ({"tunings": []}, [{}]),
    smc.plot: ({"table": ONE}, [{}]),
    smc.show: ({"what": ONE}, [{}]),
    smc.film: ({"traces": ONE, "at": 0.0, "path": "a.png", "size": (320, 180)}, [
        {"at": -0.1}, {"at": 0.02}, {"at": None}, {"path": "a.jpg"}, {"path": "a.mp4"}, {"size": (318, 180)},
        {"size": (1922, 1080)}, {"size": (481, 270)}, {"span": (0.0, 1.0)}, {"at": None, "path": "a"},
        {"at": None, "path": "a.mp4", "fps": 0.5}, {"at": None, "path": "a.mp4", "speed": 0.005},
        {"at": None, "path": "a.mp4", "speed": 101.0}, {"at": None, "path": "a.mp4", "span": (5.0, 6.0)},
        {"camera": (0.0, 91.0)}, {"traces": [ONE] * 9}, {"traces": []},
    ]),
}  # fmt: skip


@pytest.mark.parametrize("call", REFUSED, ids=lambda call: call.__name__)
def test_what_cannot_be_drawn_is_refused(call, refused):
    given, changes = REFUSED[call]
    for change in changes:
        refused(lambda arguments=given | change: call(**arguments))
