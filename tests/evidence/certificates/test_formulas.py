"""What the checker and the search compute, against plain formulas and dense samples of the loop."""

import itertools
import math
import re
from types import SimpleNamespace as Space

import numpy as np
import pytest

import smc_mujoco as smc

pytest.importorskip("flint", reason="python-flint is not installed: the extra proof does")
from smc_mujoco.evidence.certificates import checker, loops, maker, search
from smc_mujoco.evidence.certificates.checker import arb

LAWS = {
    "observer_free": {"lam": 2.3, "k1": 1.7},
    "boundary_layer": {"k": 2.3, "c": 1.7, "phi": 0.4},
    "classical": {"k": 2.3, "c": 1.7},
    "lqr": {
        "a1": 0.7,
        "a2": -0.3,
        "b": 1.9,
        "q1": 12.0,
        "q2": 1.3,
        "r": 0.6,
    },
}


def space(**values):
    """Numbers by name, as balls."""
    return Space(**{name: arb(value) for name, value in values.items()})


def plant(**terms):
    """A plant of the checker, in one channel: M x'' = A sin x + B x + C x^3 - (E + F x^2) x'."""
    return Space(**vars(space(**dict.fromkeys("ABCEF", 0.0) | {"M": 1.3, "kc": 0.0} | terms)), n=1)


def loop(law, terms, d0=0.0):
    """The same plant with a law, as the search has it."""
    its = [dict.fromkeys("ABCEF", 0.0) | terms][0]
    return loops._loop(1.3, [its[name] for name in "ABCEF"], Space(name=law, **LAWS[law]), 4.0, d0)


@pytest.mark.parametrize("law", LAWS)
def test_maker_and_checker_have_the_same_force_of_a_law(law):
    f = checker.feedback({"name": law, "gains": LAWS[law]}, 4.0)
    made = loop(law, {})
    assert float(f.c) == pytest.approx(made.c)
    assert math.inf if f.a is None else float(f.a) == pytest.approx(made.steep)
    for s in (-3.1, -0.7, -0.05, 0.02, 0.3, 2.6):
        assert float(checker.sigma(f, arb(s))) == pytest.approx(float(made.sigma(np.array(s))))
        rise = (made.sigma(np.array(s + 1e-6)) - made.sigma(np.array(s - 1e-6))) / 2e-6
        assert float(checker.slope(f, arb(s))) == pytest.approx(float(rise), rel=1e-6, abs=1e-6)
    assert float(f.room[0]) == pytest.approx(0.0 if law == "lqr" else 4.0 - 2.3)


def test_gains_of_a_quadratic_law_solve_its_riccati_equation():
    its = Space(name="lqr", **LAWS["lqr"])
    k = np.array([loops.linear_gains(its)])
    A = np.array([[0.0, 1.0], [its.a1, its.a2]])
    P = np.zeros((2, 2))
    P[1] = its.r * k / its.b  # k = b' P / r
    P[0, 1] = P[1, 0]
    P[0, 0] = k[0, 0] * its.r * k[0, 1] - its.a1 * P[1, 1] - its.a2 * P[0, 1]
    np.testing.assert_allclose(
        A.T @ P + P @ A - k.T @ k * its.r, -np.diag([its.q1, its.q2]), atol=1e-9
    )


def test_margins_of_a_saturated_law_are_those_of_its_theorem():
    A = 0.4
    B = 0.3
    C = -0.2
    e, feeds = (
        Space(
            **vars(
                plant(
                    A=A,
                    B=B,
                    C=cubic,
                    E=0.9,
                    kc=0.5,
                )
            )
            | {"n": 2}
        )
        for cubic in (C, -C)
    )
    f = checker.feedback({"name": "observer_free", "gains": LAWS["observer_free"]}, 4.0)
    V = {
        "v^2": 0.65,
        "sigma": 2.3 / 1.7,
        "cos x - 1": A,
        "x^2": -B / 2,
        "x^4": -C / 4,
        "springs": 0.25,
    }
    x = np.linspace(0.0, 2.0, 4001)[1:]
    share = (1.0 - (A * np.sin(x) + B * x + C * x**3) / (2.3 * np.tanh(1.7 * x))).min()
    boxes = [*map(list, itertools.pairwise([*np.linspace(0.0, 2.0, 201).tolist(), None]))]
    weak = {
        "margin": 1.0 - (A * math.sin(9.0) + 9.0 * B - 729.0 * C) / (2.3 * math.tanh(15.3)),
        "at": 9.0,
    }
    expected = {
        "damping": 0.9,
        "restoring": None,
        "actuator": 1.7,
        "local": 2.3 * 1.7 - A - B,
    }

    def margins(reported, e=e, mechanism="equation", **changes):
        data = {"V": V | changes, "conditions": [None, reported]}
        found = checker.saturated({"plant": {"mechanism": mechanism}}, data, e, f)
        return {name: value and float(value[0]) for name, value in found.items()}

    reported = {"margin": 0.9999 * share, "boxes": boxes}
    assert margins(reported) == pytest.approx(expected | {"coupling": 0.5})
    springs = margins(reported, mechanism="springs")
    assert springs["coupling"] == pytest.approx(-0.5 * 0.2172336282112216)
    with pytest.raises(checker.Refused, match="x from"):
        margins(reported | {"margin": 1.001 * share})
    for name, value in V.items():
        with pytest.raises(checker.Refused, match=re.escape(f"the coefficient of {name} in V")):
            margins(reported, **{name: value + 1e-6})
    feeding = {"x^4": C / 4}  # of a spring that feeds the motion, where the law is too weak
    assert margins(weak, feeds, **feeding)["restoring"] is None
    strong = {"margin": 1.0 - (A * math.sin(0.5) + 0.5 * B - 0.125 * C) / (2.3 * math.tanh(0.85))}
    for wrong in (weak | {"at": -9.0}, strong | {"at": 0.5}):
        with pytest.raises(checker.Refused, match="the place where the law is too weak"):
            margins(wrong, feeds, **feeding)
    with pytest.raises(checker.Refused, match="the margin of restoring"):
        margins(weak)


@pytest.mark.parametrize(
    "terms",
    [
        {"A": 0.8},
        {"B": -0.7, "E": 0.3},
        {"C": -0.9, "F": -0.4},
        {"C": 0.5, "E": 2.9, "F": 0.8},
    ],
)
def test_a_set_is_reached_up_to_where_the_plant_is_as_strong_as_the_law(terms):
    e = plant(**terms)
    made = loop("classical", terms)
    f = checker.feedback({"name": "classical", "gains": LAWS["classical"]}, 4.0)
    doc = {"disturbance": 0.35, "law": {"name": "classical"}}

    def strongest(x, s):
        v = s - 1.7 * x
        return np.abs(made.phi(x) + (1.3 * 1.7 - made.D(x)) * v) + 0.35

    def accepted(X):
        try:
            return checker.reaching(doc, {"X": X, "S": 0.5 * X}, e, f)
        except checker.Refused:
            return None

    sizes = np.linspace(0.05, 1.2, 47)
    found = max(X for X in sizes if accepted(X))
    x, s = np.meshgrid(*np.linspace(-1.0, 1.0, 201)[None].repeat(2, 0))
    exact = max(X for X in sizes if strongest(x * X, 0.5 * s * X).max() < 2.3)
    assert 0.85 * exact <= found <= exact
    margins = accepted(found)
    least = 2.3 - strongest(x * found, 0.5 * s * found).max()
    assert margins
    assert least - 0.1 < float(margins["reaching"][0]) <= least
    assert float(margins["actuator"][0]) == pytest.approx(1.7)


@pytest.mark.parametrize("law", ["observer_free", "boundary_layer", "classical"])
def test_w_falls_in_a_cell_where_it_falls_at_all_samples_and_both_sides_say_so(law):
    terms = {
        "A": 0.4,
        "B": -0.3,
        "C": -0.2,
        "E": 0.6,
        "F": 0.3,
    }
    d0 = 0.25
    e = plant(**terms)
    made = loop(law, terms, d0)
    f = checker.feedback({"name": law, "gains": LAWS[law]}, 4.0)
    random = np.random.default_rng(6)
    seen = []
    for _ in range(60):
        x = np.cumsum(random.uniform(0.02, 0.15, 2))
        s = random.choice([-1.0, 1.0]) * random.uniform(0.05, 0.5)
        if s > 0.0:
            edges = np.array([s, s + 0.1])
        else:
            edges = np.array([s - 0.1, s])
        corners = random.uniform(0.2, 0.6, 4)
        corners[3] = corners[1] + corners[2] - corners[0] + random.uniform(-0.01, 0.01)
        least, most = search.falls(made, x, edges, corners.reshape(4, 1, 1))
        a, b = np.meshgrid(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 5), indexing="ij")
        X = x[0] + a * np.diff(x)
        S = edges[0] + b * 0.1
        w00, w10, w01, w11 = corners
        Wx = ((1 - b) * (w10 - w00) + b * (w11 - w01)) / np.diff(x)
        Ws = ((1 - a) * (w01 - w00) + a * (w11 - w10)) / 0.1
        rates = []
        for d in (-d0, d0):
            rates.append(Wx * (S - 1.7 * X) + Ws * made.fall(X, S, d))
        worst = np.maximum(*rates)
        assert least[0, 0] == pytest.approx(worst.min())
        assert most[0, 0] == pytest.approx(worst.max())
        proven = checker.falls(e, f, arb(d0), (*x, *edges), tuple(corners))
        seen.append((proven, worst.max() / np.abs(worst).max()))
    assert all(top < 0.0 for proven, top in seen if proven)
    assert all(proven for proven, top in seen if top < -0.05)
    assert {proven for proven, _ in seen} == {True, False}


def test_a_form_attracts_where_it_falls_on_a_dense_grid():
    terms = {
        "A": 0.7,
        "B": 0.2,
        "C": -0.3,
        "E": -0.4,
        "F": 0.5,
    }
    e = plant(**terms)
    made = loop("observer_free", terms)
    f = checker.feedback({"name": "observer_free", "gains": LAWS["observer_free"]}, 4.0)

    def attracts(P):
        try:
            checker.quadratic([P[0, 0], P[0, 1], P[1, 1]], e, f, ())
        except checker.Refused:
            return False
        return True

    P = search.form(made, 2.0, attracts)
    assert P is not None

    def falls(P):
        angle, radius = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 361), np.linspace(0.02, 1.0, 50))
        z = np.linalg.solve(
            np.linalg.cholesky(P).T, np.stack([np.cos(angle), np.sin(angle)]).reshape(2, -1)
        )
        z = z * radius.ravel()
        rate = np.stack([z[1] - 1.7 * z[0], made.fall(z[0], z[1], 0.0)])
        return bool((np.sum(z * (P @ rate), axis=0) < 0.0).all())

    scales = np.geomspace(0.3, 40.0, 60)
    assert falls(P)
    proven, exact = (max(k for k in scales if test(P / k)) for test in (attracts, falls))
    assert 1.0 <= proven < 1.3  # the search leaves a tenth
    assert 0.2 * exact < proven <= exact
    inside = np.linalg.solve(
        np.linalg.cholesky(P).T, [[0.6], [0.8]]
    ).ravel()  # on the border of z' P z <= 1
    numbers = [P[0, 0], P[0, 1], P[1, 1]]
    checker.quadratic(numbers, e, f, [tuple(0.999 * inside)])
    with pytest.raises(checker.Refused, match="a form around the inner set"):
        checker.quadratic(numbers, e, f, [tuple(1.001 * inside)])


# the maker


@pytest.mark.parametrize(
    ("signals", "bound"),
    [
        ((), 0.0),
        (smc.Constant(-0.5), 0.5),
        ((smc.Sine(0.5, 3.0), smc.Constant(0.25)), 0.75),
        (smc.Step(0.5, 1.0), 0.5),
    ],
)
def test_the_bound_of_a_disturbance_is_that_of_its_sum(signals, bound):
    one = smc.Scenario(plant="duffing", law="classical", disturbance=signals)
    assert maker._bound(one) == pytest.approx(bound)


def test_a_law_that_is_bounded_is_too_weak_far_from_a_force_that_grows():
    terms = {"B": 0.05}  # so weak that the law is stronger wherever the search looks for its margin
    reported = next(
        maker._restoring(loop("observer_free", terms), [0.0, terms["B"], 0.0, 0.0, 0.0])
    )
    assert reported["margin"] < 0.0 < reported["at"]
