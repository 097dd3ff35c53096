"""Certificates: margins by hand, mutants that the checker refuses, starts that never leave, bounds
that hold.
"""

import copy
import dataclasses
import functools
import json
import math
import shutil
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control import gain_sets
from smc_mujoco.control.law import catalogue
from smc_mujoco.evidence.certificates.certificate import Certificate

pytest.importorskip("flint", reason="python-flint is not installed: the extra proof does")
from smc_mujoco.evidence.certificates import checker, loops, maker

# gains that keep |u| <= u_max, an integral faster than d, a region with the start in it: tuned ones
# need not
KEPT = {
    ("van_der_pol", "observer_free"): {"lam": 6.0, "k1": 1.992},
    ("inverted_pendulum", "classical"): {"k": 1.523, "c": 15.36},
}


def scenario(plant, law="observer_free", gains="tuned", **changes):
    fields = {"duration": 8.0} | changes
    kept = KEPT.get((plant, law))
    return smc.Scenario(
        plant=plant,
        law=smc.law(law, **kept) if kept else gain_sets.law(plant, law, gains),
        **fields,
    )


@functools.cache
def certificate(plant, law="observer_free", disturbance=0.0, gains="tuned"):
    if disturbance:
        within = smc.Uncertainty(disturbance=disturbance)
    else:
        within = None
    return smc.audits.certify(scenario(plant, law, gains), within)


def refused(data):
    """Whether the checker refuses data, though their seal is that of these data."""
    data["seal"] = checker.seal(data)
    try:
        checker.check(data)
    except checker.Refused:
        return True
    return False


def part(data, theorem):
    return next(one for one in data["parts"] if one["theorem"] == theorem)


def margins(made, theorem="saturated PD"):
    return {one.name: one.margin for one in made.conditions if one.theorem == theorem}


# conditions


def test_margins_are_those_of_the_formulas():
    reported = margins(certificate("inverted_pendulum"))
    p = smc.plant("inverted_pendulum").parameters
    gains = gain_sets.law("inverted_pendulum", "observer_free").gains
    weight = p["m"] * p["grav"] * p["l"]
    assert reported["damping"] == p["b"]
    assert reported["actuator"] == pytest.approx(6.0 - gains["lam"])
    assert reported["local"] == pytest.approx(gains["lam"] * gains["k1"] - weight)
    x = np.linspace(1e-3, 20.0, 100_000)
    exact = (1.0 - weight * np.sin(x) / (gains["lam"] * np.tanh(gains["k1"] * x))).min()
    assert exact - 2e-4 < reported["restoring"] < exact


@pytest.mark.slow
def test_van_der_pol_has_no_global_theorem_but_a_region():
    made = certificate("van_der_pol")
    assert not made.stable
    assert margins(made)["damping"] == -smc.plant("van_der_pol").parameters["mu"]
    assert made.sentences[0] == "not proven by saturated PD: damping"
    assert made.theorem == "level sets"
    assert made.bound == 0.0


def test_a_coupling_that_is_no_spring_fails_by_its_margin():
    network = smc.plant("inverted_pendulum_network", kc=-0.3)
    made = smc.audits.certify(
        smc.Scenario(plant=network, law=gain_sets.law(network, "observer_free"))
    )
    assert (made.stable, margins(made)["coupling"]) == (False, -0.3)
    real = scenario("pendulum_network", mechanism="springs")  # its torque is kc sin(x_j - x_i)
    z = np.linspace(0.1, 20.0, 1_000_001)
    assert margins(smc.audits.certify(real))["coupling"] == pytest.approx(
        0.5 * (np.sin(z) / z).min(), rel=1e-8
    )
    assert certificate("pendulum_network").stable


def test_hanging_pendulums_need_more_than_their_weight_to_be_stable_from_everywhere():
    """Not every lam > 0 does: with less than the weight they rest a turn away, too."""
    plant = smc.plant("pendulum_network")
    weight = math.prod(plant.parameters[name] for name in ("m", "grav", "l"))
    for lam, stable in (
        (0.9 * weight, False),
        (1.1 * weight, True),
    ):
        made = smc.audits.certify(
            smc.Scenario(plant=plant, law=smc.law("observer_free", lam=lam, k1=5.0))
        )
        assert made.stable is stable
        assert (margins(made)["restoring"] < 0.0) is not stable


@pytest.mark.parametrize("plant", loops.ONE_JOINT_TERMS)
def test_the_equations_of_maker_and_checker_are_those_of_the_plant(plant):
    made = smc.plant(plant)
    rng = np.random.default_rng(1)
    e = checker.equation(
        {
            "name": plant,
            "n": made.n,
            "parameters": dict(made.parameters),
            "mechanism": "equation",
        }
    )
    M, A, B, C, E, F = loops.ONE_JOINT_TERMS[plant](made.values({}))
    for x, v in rng.uniform(-3.0, 3.0, (20, 2)):
        f, g = made.nominal(np.full(made.n, x), np.full(made.n, v), 0, made.values({}))
        force = A * math.sin(x) + B * x + C * x**3 - (E + F * x * x) * v
        assert f / g == pytest.approx(force, rel=1e-12)
        assert 1.0 / g == pytest.approx(M)
        assert float(checker.phi(e, checker.arb(x)) - (e.E + e.F * x * x) * v) == pytest.approx(
            force, rel=1e-12
        )


@pytest.mark.parametrize(
    ("plant", "law"),
    [
        ("duffing", "boundary_layer"),
        ("duffing", "lqr"),
        ("duffing", "classical"),
        ("van_der_pol", "classical"),
    ],
)
def test_other_laws_have_their_theorems(plant, law):
    made = certificate(plant, law)
    made.check()
    assert made.theorems[0] == "saturated PD"
    assert made.stable == (plant == "duffing")


@pytest.mark.slow
def test_classical_comes_to_rest_from_a_set_under_a_disturbance():
    made = certificate("inverted_pendulum", "classical", 1.0)
    assert (made.bound, made.stable) == (None, False)  # its own start lies outside
    assert made.sentences[2].startswith("proven by level sets")
    assert ("level sets", "end in |x| up to", 0.0, "rad") in made.ranges
    near = smc.audits.certify(
        scenario("inverted_pendulum", "classical", x0=0.07), smc.Uncertainty(disturbance=1.0)
    )
    assert near.bound == 0.0


def test_a_law_as_strong_as_the_disturbance_reaches_nothing():
    within = smc.Uncertainty(disturbance=1.0)
    made = smc.audits.certify(
        smc.Scenario(plant="duffing", law=smc.law("classical", k=1.0)), within
    )
    assert made.sentences[1] == "not proven by reaching: reaching"


@pytest.mark.slow
def test_the_margin_of_a_set_is_that_of_its_weakest_place():
    """The weight is largest at pi/2, within the set; at its end the margin is 3.9 N m."""
    law = smc.law("classical", k=5.0, c=0.5)
    within = smc.Uncertainty(disturbance=1.0)
    made = smc.audits.certify(smc.Scenario(plant="inverted_pendulum", law=law), within)
    assert part(made.data, "reaching")["X"] > 3.0
    assert margins(made, "reaching")["reaching"] < 5.0 - 1.0 - 0.5 * 9.81 * 0.5


@pytest.mark.slow
def test_levels_of_a_law_that_switches_fall_along_its_surface():
    """Where W is level far out, s = 0 leads nowhere: the outer level lies below."""
    law = smc.law("classical", k=5.0, c=0.3)
    within = smc.Uncertainty(disturbance=1.0)
    assert smc.audits.certify(smc.Scenario(plant="duffing", law=law), within).bound == 0.0


def test_the_bound_is_that_of_the_inner_level_to_its_last_digit():
    plant = smc.plant(
        "van_der_pol",
        M=0.685,
        mu=0.164,
        k=0.803,
    )
    law = smc.law("classical", k=2.271, c=0.275)
    assert smc.audits.certify(smc.Scenario(plant=plant, law=law, x0=1.58)).bound == 0.0


# the checker


SATURATED = "saturated PD"
LEVELS = "level sets"


def set_margin(theorem, name, change):
    def mutate(data):
        (one,) = (one for one in part(data, theorem)["conditions"] if one["name"] == name)
        one["margin"] = change(one["margin"])

    return mutate


def put(*path, change):
    """A mutant that changes the value at a path; a text stands for the theorem of a part."""

    def mutate(data):
        at = data
        for key in path[:-1]:
            if at is data.get("parts"):
                at = part(data, key)
            else:
                at = at[key]
        at[path[-1]] = change(at[path[-1]])

    return mutate


def times(factor):
    return lambda value: value * factor


def without(i):
    return lambda items: items[:i] + items[i + 1 :]


def told_twice(data):
    saturated = part(data, SATURATED)
    saturated["conditions"].append({"name": "restoring", "margin": 0.5})
    saturated["holds"] = True


def farther(data):
    """Let the inner set grow beyond that from which s = 0 is reached."""
    levels = part(data, LEVELS)
    levels["inner"], W = 0.5 * levels["outer"], np.array(levels["W"])
    low = np.minimum.reduce([W[:-1, :-1], W[1:, :-1], W[:-1, 1:], W[1:, 1:]])
    levels["bound"] = max(
        x for x, row in zip(levels["x"][1:], low, strict=True) if row.min() <= levels["inner"]
    )


def raised(W):
    W[30][110] += 0.05
    return W


MUTANTS = {
    "sign of damping": set_margin(SATURATED, "damping", times(-1)),
    "sign of restoring": set_margin(SATURATED, "restoring", times(-1)),
    "restoring a little larger": set_margin(SATURATED, "restoring", times(1.001)),
    "sign of local": set_margin(SATURATED, "local", times(-1)),
    "local a little larger": set_margin(SATURATED, "local", times(1.001)),
    "start": set_margin(LEVELS, "start", times(1.001)),
    "a box left out": put(
        "parts",
        SATURATED,
        "conditions",
        1,
        "boxes",
        change=without(7),
    ),
    "the box to infinity left out": put(
        "parts", SATURATED, "conditions", 1, "boxes", change=without(-1)
    ),
    "a box shifted": put(
        "parts",
        SATURATED,
        "conditions",
        1,
        "boxes",
        9,
        0,
        change=times(1.001),
    ),
    "mass in V": put(
        "parts",
        SATURATED,
        "V",
        "v^2",
        change=times(1.001),
    ),
    "spring in V": put(
        "parts",
        SATURATED,
        "V",
        "x^2",
        change=times(1.001),
    ),
    "another theorem": put(
        "parts",
        LEVELS,
        "theorem",
        change=lambda _: "reaching",
    ),
    "mass of the plant": put(
        "plant",
        "parameters",
        "M",
        change=times(1.001),
    ),
    "spring of the plant": put(
        "plant",
        "parameters",
        "alpha",
        change=times(1.001),
    ),
    "another plant": put("plant", "name", change=lambda _: "van_der_pol"),
    "lam": put(
        "law",
        "gains",
        "lam",
        change=times(1.001),
    ),
    "k1": put("law", "gains", "k1", change=times(0.999)),
    "another law": put("law", "name", change=lambda _: "boundary_layer"),
    "a weaker actuator": put("u_max", change=lambda _: 4.0),
    "a smaller bound": put(
        "parts",
        LEVELS,
        "bound",
        change=times(0.999),
    ),
    "a smaller inner level": put(
        "parts",
        LEVELS,
        "inner",
        change=times(0.1),
    ),
    "an outer level beyond the grid": put(
        "parts",
        LEVELS,
        "outer",
        change=lambda _: 0.9999,
    ),
    "a hill in W": put(
        "parts",
        LEVELS,
        "W",
        change=raised,
    ),
    "a row of W left out": put(
        "parts",
        LEVELS,
        "W",
        change=without(20),
    ),
    "a larger disturbance": put("disturbance", change=times(1.5)),
    "another start": put(
        "parts",
        LEVELS,
        "start",
        change=lambda _: [2.9, 5.0],
    ),
    "another unit": put("unit", change=lambda _: "rad"),
    "another mechanism": put("plant", "mechanism", change=lambda _: "springs"),
    "two carts": put("plant", "n", change=lambda _: 2),
}


@pytest.mark.slow
def test_the_checker_accepts_what_is_no_mutant():
    assert not refused(copy.deepcopy(certificate("duffing", disturbance=2.0).data))


@pytest.mark.parametrize("name", MUTANTS)
def test_the_checker_refuses_a_mutant_with_a_new_seal(name):
    data = copy.deepcopy(certificate("duffing", disturbance=2.0).data)
    MUTANTS[name](data)
    assert refused(data)


CHANGED = {  # case -> plant, law, gains; u_max is 6
    "observer_free": ("duffing", "observer_free", {"lam": 5.0, "k1": 2.0}),
    "observer_free, clipped": ("duffing", "observer_free", {"lam": 9.0, "k1": 2.0}),
    "boundary_layer": ("duffing", "boundary_layer", {"k": 5.0, "c": 2.0, "phi": 0.3}),
    "boundary_layer of a network": ("pendulum_network", "boundary_layer", {"k": 9.0}),
    "lqr": ("duffing", "lqr", {"q1": 30.0, "a1": 0.5, "a2": -0.2}),
    "classical": ("duffing", "classical", {"k": 5.0, "c": 2.0}),
    "classical, clipped": ("duffing", "classical", {"k": 9.0, "c": 2.0}),
    "classical of a network": ("pendulum_network", "classical", {"k": 9.0, "c": 2.0}),
}


@pytest.mark.parametrize("case", CHANGED)
def test_a_law_changed_in_a_certificate_is_refused_under_a_new_seal(case):
    plant, law, gains = CHANGED[case]
    made = smc.audits.certify(smc.Scenario(plant=plant, law=smc.law(law, **gains)))
    whole: Any = made.data
    for gain, value in whole["law"]["gains"].items():
        for other in (1.001, 0.5, 1e9):
            data = copy.deepcopy(whole)
            data["law"]["gains"][gain] = other * (1.0 if value is None else value or 1e-6)
            assert refused(data), (gain, other)
        assert refused(changed(whole, ("law", "gains"), lambda gains, name=gain: gains.pop(name)))
    for name, template in catalogue().items():
        if name != law:
            assert refused(changed(whole, ("law",), lambda it, name=name: it.update(name=name)))
        for unread in template.gains.keys() - whole["law"]["gains"].keys():
            added = {unread: template.gains[unread].default}
            assert refused(
                changed(whole, ("law", "gains"), lambda it, added=added: it.update(added))
            )


@pytest.mark.parametrize(
    "field", [f.name for f in dataclasses.fields(smc.Uncertainty) if f.name != "disturbance"]
)
def test_a_class_with_more_than_a_bound_of_d_is_refused(field):
    """A slope was taken and ignored."""
    value: Any = 0.1
    if field == "parameters":
        value = {"delta": (0.5, 2.0)}
    elif "tuple" in str(smc.Uncertainty.__annotations__[field]):
        value = 3.0, 4.0
    within = smc.Uncertainty(disturbance=1.0, **{field: value})
    with pytest.raises(smc.ScenarioError, match=r"has disturbance 1 N, .*a bound of d alone"):
        smc.audits.certify(scenario("duffing"), within)


def numbers(value, path=()):
    """The places of all numbers in a certificate."""
    if isinstance(value, dict | list):
        for name, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(item, (*path, name))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def scaled(data, factor):
    """Make the certificate that of a plant in other units of force."""
    for name in data["plant"]["parameters"]:
        data["plant"]["parameters"][name] *= factor
    data["law"]["gains"]["k"] *= factor
    data["u_max"] *= factor
    (saturated,) = data["parts"] = [part(data, SATURATED)]
    saturated["V"] = {term: value * factor for term, value in saturated["V"].items()}
    for condition in saturated["conditions"]:
        if condition["name"] == "restoring":
            condition["margin"] *= 1.0
        else:
            condition["margin"] *= factor


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan, 10**400, True, "1.0"])
@pytest.mark.parametrize(
    ("plant", "law"),
    [
        ("duffing", "observer_free"),
        ("duffing", "classical"),
    ],
)
def test_the_checker_refuses_what_is_no_finite_number_wherever_it_stands(plant, law, wrong):
    whole = copy.deepcopy(certificate(plant, law, disturbance=0.1).data)
    places = list(numbers(whole))
    drawn = np.random.default_rng(0).choice(len(places), 12, replace=False)
    at_top = [at for at, path in enumerate(places) if len(path) == 1]
    for at in {*drawn.tolist(), *at_top}:
        data: Any = copy.deepcopy(whole)
        *inner, last = places[at]
        item = data
        for name in inner:
            item = item[name]
        item[last] = wrong
        assert refused(data), places[at]


def dicts(value, path=()):
    """The places of all dicts in a certificate."""
    if isinstance(value, dict):
        yield path
    if isinstance(value, dict | list):
        for name, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from dicts(item, (*path, name))


def changed(whole, path, change):
    """A copy of a certificate in which the thing at a path is changed in place."""
    data = at = copy.deepcopy(whole)
    for name in path:
        at = at[name]
    change(at)
    return data


NOT_LEFT_OUT = [
    ("duffing", "classical"),
    ("pendulum_network", "observer_free"),
]


@pytest.mark.parametrize(("plant", "law"), NOT_LEFT_OUT)
def test_the_checker_refuses_fields_that_the_format_lacks_and_fields_left_out(plant, law):
    whole: Any = copy.deepcopy(certificate(plant, law, 0.1 * (plant == "duffing")).data)
    whole["parts"] = [one for one in whole["parts"] if one["theorem"] != LEVELS]
    assert not refused(copy.deepcopy(whole))
    tried = 0
    for path in dicts(whole):
        at: Any = functools.reduce(lambda item, name: item[name], path, whole)
        for added in (
            {"name": "stable everywhere"},
            {"theorem": "all"},
            {"holds": True},
            {"extra": 1.0},
            {"bound": 0.0},
        ):
            if not added.keys() & at.keys():
                assert refused(changed(whole, path, lambda it, added=added: it.update(added))), (
                    path,
                    added,
                )
                tried += 1
        for name in at.keys() - {"seal"}:
            assert refused(changed(whole, path, lambda it, name=name: it.pop(name))), (path, name)
            tried += 1
    assert tried > 50


def test_a_field_that_is_there_twice_is_refused(tmp_path, monkeypatch):
    made = certificate("duffing", "classical")
    twice = tmp_path / "twice.json"
    twice.write_text(
        json.dumps(dict(made.data)).replace(
            '"disturbance"', '"disturbance": 99.0, "disturbance"', 1
        )
    )
    with pytest.raises(SystemExit, match="not proven is which of two fields of one name counts"):
        checker.main([twice])
    with pytest.raises(SystemExit, match="is refused: it is no JSON file"):
        checker.main([tmp_path / "absent.json"])


@pytest.mark.parametrize("factor", [1e-13, 1e-6, 1.0, 1e6])
def test_units_do_not_hide_a_plant_that_feeds_its_motion(factor):
    data: Any = copy.deepcopy(certificate("duffing", "classical", disturbance=0.1).data)
    data["disturbance"] = 0.0
    scaled(data, factor)
    assert not refused(copy.deepcopy(data))
    data["plant"]["parameters"]["delta"] *= -0.9
    assert refused(data)


OTHERS = {
    "no damping that is told as damping": (
        "van_der_pol",
        "observer_free",
        set_margin(SATURATED, "damping", abs),
    ),
    "a form that is too narrow": (
        "van_der_pol",
        "observer_free",
        put("parts", LEVELS, "P", 0, change=times(9)),
    ),
    "a form that does not fall": (
        "van_der_pol",
        "observer_free",
        put("parts", LEVELS, "P", 1, change=times(-9)),
    ),
    "a condition told twice": ("inverted_pendulum", "classical", told_twice),
    "a farther inner set": ("inverted_pendulum", "classical", farther),
    "a set that is too large": (
        "duffing",
        "classical",
        put("parts", "reaching", "X", change=times(1.3)),
    ),
    "a higher strip": (
        "duffing",
        "classical",
        put(
            "parts",
            "reaching",
            "S",
            change=times(1.001),
        ),
    ),
    "a spring that pushes": (
        "pendulum_network",
        "observer_free",
        put(
            "plant",
            "parameters",
            "kc",
            change=times(-1),
        ),
    ),
    "inverted pendulums": (
        "pendulum_network",
        "observer_free",
        put("plant", "name", change=lambda _: "inverted_pendulum_network"),
    ),
}


@pytest.mark.parametrize("name", OTHERS)
def test_the_checker_refuses_mutants_of_other_theorems(name):
    plant, law, mutate = OTHERS[name]
    data = copy.deepcopy(certificate(plant, law).data)
    mutate(data)
    if "told as" in name:
        part(data, SATURATED)["holds"] = True
    assert refused(data)


def test_the_checker_stands_alone(tmp_path):
    """It imports nothing of ours, and runs as a file by itself."""
    shutil.copy(checker.__file__, tmp_path / "apart.py")
    made = certificate("duffing", disturbance=2.0)
    file = made.save(tmp_path / "duffing.json")
    assert Certificate.load(file).data == made.data
    run = functools.partial(
        subprocess.run,
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    done = run([sys.executable, "-I", "apart.py", "duffing.json"])
    assert done.returncode == 0
    assert done.stdout == "duffing.json is accepted: every statement is proven\n"
    file.write_text(file.read_text().replace('"bound": 0.', '"bound": 0.0'))
    done = run([sys.executable, "-I", "apart.py", "duffing.json"])
    assert done.returncode == 1
    assert done.stderr == "duffing.json is refused: not proven is the seal\n"


# runs


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "d0"),
    [
        ("duffing", 2.0),
        ("inverted_pendulum", 1.0),
    ],
)
def test_the_bound_contains_the_worst_found_and_is_below_twice_as_large(plant, d0):
    """The worst found by the adversary, on the machine that MuJoCo samples."""
    made = certificate(plant, disturbance=d0)
    within = smc.Uncertainty(disturbance=d0)
    worst = smc.worst_case(
        scenario(plant, duration=4.0),
        "ultimate_bound",
        within,
        budget=16,
    )
    assert made.bound is not None
    assert worst.value <= made.bound <= 2.0 * worst.value


@pytest.mark.slow
def test_region_of_van_der_pol_as_a_share_of_the_true_one():
    made = certificate("van_der_pol")
    found = smc.design.basin("van_der_pol", scenario("van_der_pol").law, points=(8, 8))
    x, v = np.meshgrid(found.x, found.v)
    inside = made.contains(x, v)
    assert inside.any()
    assert (found.outcome[inside] == 1).all()


@pytest.mark.slow
def test_without_damping_no_bound_holds_from_everywhere():
    """What docs/what_the_author_may_claim.md says of d = d0 sgn(v): swings shrink from 10 rad and
    grow from 20.
    """
    free = smc.plant("inverted_pendulum", b=0.0)
    made = smc.audits.certify(smc.Scenario(plant=free, law=gain_sets.law(free, "observer_free")))
    loop, _, _ = loops.loop_of(made.data)
    x = np.array([10.0, 20.0])
    v = np.zeros(2)
    reached = []
    for _ in range(20_000):
        v = v + 1e-3 * (loop.phi(x) - loop.sigma(v + loop.c * x) + np.sign(v)) / loop.M
        x = x + 1e-3 * v
        reached.append(np.abs(x))
    late = np.max(reached[10_000:], axis=0)
    assert late[0] < 10.0
    assert late[1] > 20.0


GAINS = {  # law -> the ends of its random gains
    "observer_free": {"lam": (5.5, 30.0), "k1": (0.5, 8.0)},
    "boundary_layer": {
        "k": (5.5, 30.0),
        "c": (0.5, 8.0),
        "phi": (0.05, 2.0),
    },
    "lqr": {
        "q1": (1.0, 500.0),
        "q2": (0.1, 50.0),
        "r": (0.1, 2.0),
    },
    "classical": {"k": (2.0, 30.0), "c": (0.5, 8.0)},
}


def claims(made, d0, rng):
    """What a certificate says of runs: (x0, v0, disturbance, largest |x| in the end)."""
    pushes = [smc.Constant(d0), smc.Constant(-d0)]
    for omega in (0.7, 2.0, 6.0):
        pushes.append(smc.Sine(d0, omega))
    if made.stable:
        for x0, v0 in rng.uniform(-6.0, 6.0, (20, 2)):
            yield float(x0), float(v0), None, 0.02
    for one in made.data["parts"]:
        if one["theorem"] == LEVELS:
            end = 0.0 if made.rests else one["bound"]
            x, s = rng.uniform(-1, 1, (2, 4000)) * [[one["x"][-1]], [one["s"][-1]]]
            v = s - made.surface * x
            level = made.level(x, v)
            edge = np.flatnonzero((level <= one["outer"]) & (level > 0.9 * one["outer"]))[:20]
            for k, at in enumerate(edge):
                yield float(x[at]), float(v[at]), pushes[k % 5], max(1.02 * end, 0.02)
        if one["theorem"] == "reaching":  # s = 0 is kept
            x0 = 0.95 * one["X"]
            for push in pushes:
                yield x0, -made.surface * x0, push, 0.02


@pytest.mark.slow
@pytest.mark.parametrize("law", maker.LAWS)
def test_no_run_contradicts_a_certificate(law):
    """Of random gains at the edge of what is proven: what maker and checker both overlook of a law,
    its runs do not.
    """
    rng = np.random.default_rng(len(law))
    seen = 0
    for plant in ("duffing", "van_der_pol", "inverted_pendulum"):
        gains = {}
        for name, (low, high) in GAINS[law].items():
            gains[name] = round(float(low * (high / low) ** rng.random()), 3)
        d0 = round(float(rng.uniform(0.01, 0.5)), 3)
        one = smc.Scenario(
            plant=plant,
            law=smc.law(law, **gains),
            duration=40.0,
            x0=0.05,
        )
        try:
            made = smc.audits.certify(one, smc.Uncertainty(disturbance=d0))
        except smc.ScenarioError:  # the gains are too small
            continue
        reported = list(claims(made, d0, rng))
        runs = []
        for x0, v0, push, _ in reported:
            runs.append(
                dataclasses.replace(
                    one,
                    x0=x0,
                    v0=v0,
                    disturbance=push or (),
                )
            )
        for (x0, v0, push, end), trace in zip(reported, smc.run(runs), strict=True):
            late = np.abs(trace.x[-8000:]).max()
            assert late <= end, (plant, gains, d0, x0, v0, push)
        seen += len(reported)
    assert seen > 3


def test_an_unknown_gain_of_the_input_needs_only_its_share_of_the_force():
    """Claim 10: where g(x) leaves more than 1 - margin of the force, every start comes to rest."""
    made = certificate("inverted_pendulum")
    loop, _, _ = loops.loop_of(made.data)
    share = 1.0 - margins(made)["restoring"]
    for low, rests in (
        (1.02 * share, True),
        (0.9 * share, False),
    ):
        weak = dataclasses.replace(loop, sigma=lambda s, low=low: low * loop.sigma(s))
        x = np.array([1.5, 0.8, 3.0])
        v = np.zeros(3)
        for _ in range(6_000):
            a = (weak.phi(x) - weak.D(x) * v - weak.sigma(v + weak.c * x)) / weak.M
            v = v + 1e-3 * a
            x = x + 1e-3 * v
        assert bool(np.abs(x).max() < 1e-3) is rests


def test_the_command_proves_writes_and_checks(tmp_path, monkeypatch, capsys):
    from smc_mujoco.cli.main import main

    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["certify", "van_der_pol", "--out", "d.json"])
    assert ended.value.code in (0, None)
    said = capsys.readouterr().out
    assert "level sets" in said
    assert "sampling" in said
    with pytest.raises(SystemExit) as ended:
        main(["certify", "--check", "d.json"])
    assert ended.value.code in (0, None)
    assert "d.json: every statement is proven" in capsys.readouterr().out
    data = json.loads((tmp_path / "d.json").read_text())
    data["plant"]["parameters"]["M"] = 1.1
    (tmp_path / "d.json").write_text(json.dumps(data))
    with pytest.raises(SystemExit) as ended:
        main(["certify", "--check", "d.json"])
    assert ended.value.code == 2
    assert "refused" in capsys.readouterr().err
