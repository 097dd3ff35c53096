"""What a certificate says of typed theorems, and draws of them."""

import re

import numpy as np
import pytest
from helpers.certificates import LEVELS, certificate, part
from helpers.sketch import made as trace_of
from helpers.sketch import sketch
from scipy.interpolate import RegularGridInterpolator

import smc_mujoco as smc
from smc_mujoco.evidence.certificates.certificate import Certificate

REACHED = part("reaching", {"reaching": 0.3, "actuator": 1.0}, X=1.25, S=0.5)
GLOBAL = part("saturated PD", {"damping": 0.5, "restoring": 0.2, "actuator": 0.0, "local": 1.0})
TERMINAL = part("reaching", {"reaching": 0.3, "actuator": 1.0}, X=0.81, S=0.0)
SAID = {
    "fails and falls": certificate(),
    "without d": certificate("inverted_pendulum", parts=[GLOBAL], disturbance=0.0),
    "every condition fails": certificate(
        "pendulum_network",
        parts=[
            part("saturated PD", {"damping": -1.0, "restoring": -2.0, "actuator": -3.0, "coupling": -4.0}),
            part("reaching", {"reaching": -6.0, "actuator": 0.0}, X=0.0, S=0.0),
            part("super-twisting", {"integral": -7.0, "slope": -8.0, "actuator": 9.0}),
        ],
    ),
    "a switching law": certificate(
        "inverted_pendulum", "classical", {"k": 3.0, "c": 2.0},
        [part("saturated PD", {"damping": 0.5}), REACHED, part("level sets", {"start": -0.1}, **LEVELS)],
    ),
    "nothing under a disturbance": certificate(parts=[part("saturated PD", {"damping": 0.5})]),
    "a terminal surface": certificate("duffing", "terminal", {"k": 3.0, "b": 2.0, "p": 0.75, "bound": 1.0}, [TERMINAL]),
    "super-twisting": certificate(
        "van_der_pol", "super_twisting", {"k1": 3.0, "k2": 2.0, "c": 1.5}, disturbance=0.5, slope=1.75,
        parts=[part("super-twisting", {"integral": 0.25, "slope": 0.1, "actuator": 0.2}, X=0.3)],
    ),
}  # fmt: skip


def test_a_certificate_says_what_its_theorems_say(snapshot):
    lines = []
    for name, made in SAID.items():
        lines += [f"{name}: {made!r}", *made.sentences]
        facts = (made.theorem, made.holds, made.stable, made.bound, f"{made.surface:g}")
        lines.append(f"  {', '.join(map(str, facts))}")
        lines += [f"  {one.name} {one.margin:g} {one.unit}, {one.holds}: {one.words}" for one in made.conditions]
    assert "\n".join(lines) == snapshot
    assert re.sub("(<[^>]*>)+", "|", SAID["a switching law"]._repr_html_()) == snapshot
    assert len(set(SAID.values())) == len(SAID)  # each is its own key


def test_a_certificate_prints_what_is_said_under_a_disturbance_and_no_control_characters():
    printed = repr(SAID["fails and falls"])
    assert "proven by level sets" in printed
    assert "\n" not in printed
    assert "no theorem here is about" not in printed
    named = dict(SAID["without d"].data) | {"law": {"name": "\x1b[31mred", "gains": {}}}
    assert repr(Certificate(data=named)).startswith(r"<Certificate of \x1b[31mred on inverted_pendulum: proven by")


def test_w_is_bilinear_odd_states_alike_and_1_outside():
    made = SAID["fails and falls"]
    grid = RegularGridInterpolator((LEVELS["x"], LEVELS["s"]), LEVELS["W"])
    x, s = np.random.default_rng(4).uniform(-2.2, 2.2, (2, 400))
    v = s - made.surface * x
    within = (np.abs(x) < 2.0) & (np.abs(s) < 2.0)
    sign = np.where(x[within] < 0.0, -1.0, 1.0)
    expected = np.ones_like(x)
    expected[within] = grid(np.column_stack([sign * x[within], sign * s[within]]))
    np.testing.assert_allclose(made.level(x, v), expected, atol=1e-12)
    np.testing.assert_array_equal(made.contains(x, v), expected <= LEVELS["outer"])


def test_the_set_of_a_switching_law_is_a_strip_and_of_a_stable_loop_everything():
    x, s = np.random.default_rng(5).uniform(-1.5, 1.5, (2, 400))
    box = certificate("inverted_pendulum", "classical", {"k": 3.0, "c": 2.0}, [REACHED])
    np.testing.assert_array_equal(box.contains(x, s - 2.0 * x), (np.abs(x) <= 1.25) & (np.abs(s) <= 0.5))
    assert SAID["without d"].contains(x, s).all()
    assert not SAID["a terminal surface"].contains(x, s).any()
    with pytest.raises(smc.ScenarioError, match="the certificate of terminal on duffing has no level sets"):
        SAID["a terminal surface"].level(x, s)


@pytest.mark.parametrize("name", ["fails and falls", "without d", "a switching law"])
def test_the_plane_of_a_certificate_is_drawn_as_recorded(name, snapshot, monkeypatch):
    monkeypatch.setattr("smc_mujoco.evidence.certificates.figure.AXIS_POINTS", 81)
    made = SAID[name]
    run = trace_of(smc.Scenario(plant=made.plant, law="pid", duration=0.2))
    assert sketch(made.figure(traces=[run] if made.bound else [])) == snapshot


@pytest.mark.parametrize(("name", "sentence"), [
    ("every condition fails", "the states of 5 pendulums do not fit into a plane: draw a single one"),
    ("super-twisting", "the certificate of super_twisting on van_der_pol has no region to draw"),
])  # fmt: skip
def test_what_has_no_plane_is_refused(name, sentence):
    with pytest.raises(smc.ScenarioError, match=sentence):
        SAID[name].figure()


def test_a_file_that_is_no_certificate_is_refused(tmp_path):
    SAID["without d"].save(tmp_path / "a.json")
    assert Certificate.load(tmp_path / "a.json").data == SAID["without d"].data
    (tmp_path / "b.json").write_text('{"parts": 3}')
    with pytest.raises(smc.ScenarioError, match="is not a certificate"):
        Certificate.load(tmp_path / "b.json")
