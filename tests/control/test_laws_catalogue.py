"""What every law of the library must have, walked over the catalogue: a law added is tested here
without an edit.

On every plant that it applies to, a law with its default gains ends within 5 % of where it began,
with the model or without. Memory belongs to a channel and a run, and a law is odd in what it
measures.
"""

import functools
import itertools
import math
import re
import zlib

import numpy as np
import pytest
from helpers.plants_ab import called, measured
from helpers.runs import at_defaults

import smc_mujoco as smc
from smc_mujoco.control import estimator, surface
from smc_mujoco.control.law import all_laws, law_catalogue
from smc_mujoco.metrics.catalogue import ultimate_bound
from smc_mujoco.simulation import gaber_study as paper

LAWS = pytest.mark.parametrize("name", smc.laws())
ACTING = pytest.mark.parametrize("name", [name for name in smc.laws() if name != "none"])
GENERAL = [name for name, law in law_catalogue().items() if name != "none" and not law.plants]
SLOW = ("van_der_pol",)

# Laws that work by the model alone, and why.
MODELLED = {"hierarchical": "a joint without an actuator is moved through its nominal coupling"}


def plants(name):
    """The plants that a law applies to: those that it names, or the study's, networks of three to
    save time.
    """
    if named := law_catalogue()[name].plants:
        return named
    return [smc.plant(plant, n=3) if plant.endswith("network") else plant for plant in paper.GAINS]


@functools.cache
def traces():
    """Every law on every plant that it applies to, on one without the model and on the next with
    it: law -> traces.

    Euler's rule in steps of 2 ms takes a sixth of the time of Runge and Kutta's in steps of 1 ms,
    and no bound here is near its error. Van der Pol's oscillator without its model takes the
    longest to settle.
    """
    common = {"integrator": "Euler", "control_period": 2e-3, "physics_step": 2e-3}
    by_law = {}
    for name in smc.laws():
        # one half of the laws each, whichever laws there are beside it
        first = zlib.crc32(name.encode()) % 2
        models = itertools.cycle(("none", "nominal") if first else ("nominal", "none"))
        if name in MODELLED or name == "none":
            models = itertools.repeat("nominal" if name in MODELLED else "none")
        by_law[name] = [
            smc.Scenario(
                plant=plant,
                law=at_defaults(name),
                model=model,
                duration=8.0 if plant in SLOW else 6.0,
                **common,
            )
            for plant, model in zip(plants(name), models, strict=False)
        ]
    ran = iter(smc.run([scenario for scenarios in by_law.values() for scenario in scenarios]))
    return {name: [next(ran) for _ in scenarios] for name, scenarios in by_law.items()}


@ACTING
def test_default_gains_end_within_five_percent_on_every_plant_with_the_model_or_without(name):
    bounds = {}
    for trace in traces()[name]:
        case = trace.scenario.plant.name, trace.scenario.resolved.model
        assert trace.failure is None, (case, trace.failure)
        bounds[case] = ultimate_bound(trace) / max(map(abs, trace.scenario.resolved.x0))
        assert np.abs(trace.u).max() <= 6.0
    assert bounds
    assert max(bounds.values()) <= 0.05, bounds


@pytest.mark.quick
def test_none_leaves_each_plant_where_its_equation_takes_it():
    """The pendulums fall from upright, Van der Pol goes round, Duffing goes to a well beside 0, the
    chain swings.
    """
    ends = {}
    for trace in traces()["none"]:
        ends[trace.scenario.plant.name] = np.abs(trace.x[trace.t > 2.0]).max()
    assert ends["inverted_pendulum"] > math.pi
    assert ends["inverted_pendulum_network"] > 1.0
    assert ends["van_der_pol"] == pytest.approx(2.0, abs=0.05)
    assert 0.5 < ends["duffing"] < 2.0
    assert 0.1 < ends["pendulum_network"] < 1.0


@LAWS
def test_a_law_is_odd_in_what_it_measures_and_commands_nothing_where_there_is_no_error(name):
    law = smc.law(name)
    memory = np.zeros(law.memory)
    for _ in range(3):
        assert called(law, measured(limit=6.0), memory) == (0.0, 0.0)
    for model in (0.0, 1.0):
        ours = np.zeros(law.memory)
        mirrored = np.zeros(law.memory)
        for k, (e, de, f, a) in enumerate(np.random.default_rng(0).normal(size=(100, 4))):
            common = {
                "g": 2.0,
                "t": k * 1e-3,
                "limit": 6.0,
                "model": model,
            }
            u, s = called(law, measured(e, de, f=f, a=a, **common), ours)
            assert called(law, measured(-e, -de, f=-f, a=-a, **common), mirrored) == (-u, -s)


def test_a_first_order_law_pushes_towards_its_surface():
    for law in (smc.law(name) for name in GENERAL if law_catalogue()[name].relative_degree == 1):
        for e, de in np.random.default_rng(0).normal(size=(200, 2)):
            u, s = called(law, measured(e, de, limit=6.0), np.zeros(law.memory))
            assert u * s <= 0.0, law


@functools.cache
def swings():
    """Uncoupled pendulums, one at rest and two mirrored, under every law, each twice: name -> two
    traces.
    """
    plant = smc.plant("pendulum_network", n=3, kc=0.0)
    names = [name for name in smc.laws() if not law_catalogue()[name].plants]
    scenarios = []
    for name in names:
        scenarios.append(
            smc.Scenario(
                plant=plant,
                law=at_defaults(name),
                x0=(0.5, 0.0, -0.5),
                duration=0.1,
            )
        )
    ran = smc.run(scenarios + scenarios[::-1])
    return {name: (ran[i], ran[-1 - i]) for i, name in enumerate(names)}


def test_memory_belongs_to_a_channel_and_a_run():
    """The pendulum at rest stays at rest, the others stay mirrored; a second run beside the first
    is the same.
    """
    for name, (trace, again) in swings().items():
        assert not trace.x[:, 1].any(), name
        np.testing.assert_array_equal(trace.x[:, 2], -trace.x[:, 0])
        np.testing.assert_array_equal(trace.u[:, 2], -trace.u[:, 0])
        np.testing.assert_array_equal(again.u, trace.u)
        np.testing.assert_array_equal(again.x, trace.x)


ALL = [
    *all_laws().values(),
    *surface.surface_catalogue().values(),
    *estimator.estimator_catalogue().values(),
]


@pytest.mark.parametrize("template", ALL, ids=lambda t: f"{t.kind}-{t.name}")
def test_the_gains_in_a_docstring_are_those_of_the_function(template):
    """Each part of `Gains: a, what it is; b and c, what they are.` begins with gains, and every
    gain is named.
    """
    said = re.search(r"^Gains?: (.*?)(?:\.$|\.\nSource|\Z)", template.doc, re.MULTILINE | re.DOTALL)
    assert bool(said) is bool(template.gains)
    parts = said[1].split(";") if said else []
    first = [re.findall(r"\w+", part)[0] for part in parts]
    assert set(first) <= template.gains.keys()
    assert template.gains.keys() <= set(re.findall(r"\w+", said[1] if said else ""))


@pytest.mark.filterwarnings("error")
def test_default_gains_meet_the_conditions_that_they_quote():
    for name in smc.laws():
        smc.law(name)
