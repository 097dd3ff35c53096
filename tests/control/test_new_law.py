"""A new law is one file: it alone makes the law listed, tunable, coloured, labelled, reported and
known to theory.
"""

import json

import pytest
from helpers.commands import python

NEW = '''"""Brand new: u = -k sat(s / phi), s = de + c e. Source: N. Body, "Of no use", J. Nothing 1(1):1, 2001."""

import numpy as np

from smc_mujoco.control.component import Rest
from smc_mujoco.control.law import command, law_function, sliding
from smc_mujoco.control.units import FORCE, RATE, SPEED, Gain


@law_function(
    gains={"k": Gain(6.0, FORCE), "c": Gain(2.5, RATE), "phi": Gain(0.5, SPEED), "n": Gain(1.0, FORCE, held=True)},
    label="Brand-new",
    short="NEW",
    colour="#102030",
    rest=Rest(linear=lambda g: (g.k / g.phi, g.c), force=lambda g, x: np.clip(x, -g.k, g.k)),
)
def brand_new(y, gains, memory):
    s, eq = sliding(y, gains.c)
    return command(y, eq - gains.n * gains.k * min(max(s / gains.phi, -1.0), 1.0)), s
'''
PLAIN = '''"""Plain one: u = -k s, s = de + e. Explicit. Source: none."""

from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import FORCE_PER_SPEED, Gain


@law_function(gains={"k": Gain(3.0, FORCE_PER_SPEED)})
def plain_one(y, gains, memory):
    return -gains.k * (y.de + y.e), y.de + y.e
'''
CODE = """
import importlib, json, sys
importlib.import_module("smc_mujoco.control.laws").__path__.append(sys.argv[1])
import smc_mujoco as smc
from smc_mujoco.analysis import linear_theory, margins
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.control import gain_sets
from smc_mujoco.control.properties import families
from smc_mujoco.draw import style

found = {}
for name in ("brand_new", "plain_one"):
    tuned = smc.tune("duffing", name, budget=2, objective=Objective(conditions=("nominal",), duration=0.2), searches=1)
    trace = smc.run(smc.Scenario(plant="duffing", law=name, duration=0.01))
    found[name] = {
        "listed": name in smc.laws() and name in families()["other"],
        "ranked": name in gain_sets.general_laws(["duffing"], "default"),
        "bounds": tuned.bounds,
        "label": style.labels([trace], None)[0],
        "report": style.law_name(name),
        "short": style.law_initials(name),
        "colour": style.law_colours([trace.scenario.law])[0],
        "colours": style.law_colours([*smc.laws()]),
        "linear": linear_theory.linear_gains(smc.law(name)),
    }
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What a fresh interpreter finds out about two laws whose files were put beside those of the
    library.
    """
    folder = tmp_path_factory.mktemp("more")
    (folder / "brand_new.py").write_text(NEW)
    (folder / "plain_one.py").write_text(PLAIN)
    return json.loads(python("-c", CODE, folder).stdout.splitlines()[-1])


@pytest.mark.parametrize(
    ("name", "label", "short", "linear"),
    [("brand_new", "Brand-new", "NEW", [12.0, 2.5]), ("plain_one", "Plain one", "PO", None)],
)
def test_new_law_is_listed_ranked_labelled_and_known_to_linear_theory(
    found, name, label, short, linear
):
    one = found[name]
    assert (one["listed"], one["ranked"]) == (True, True)
    assert one["label"] == one["report"] == label
    assert (one["short"], one["linear"]) == (short, linear)


def test_new_law_is_tuned_in_the_box_of_its_units(found):
    X, M, u_max = 1.5, 1.0, 6.0  # of the Duffing oscillator; its T is sqrt(M X / u_max)
    T = (M * X / u_max) ** 0.5
    scales = {"k": u_max, "c": 1.0 / T, "phi": X / T}
    bounds = found["brand_new"]["bounds"]
    assert set(bounds) == set(scales)  # n is held
    for gain, scale in scales.items():
        assert bounds[gain] == pytest.approx([scale / 10**1.5, scale * 10**1.5])
    assert found["plain_one"]["bounds"]["k"] == pytest.approx(
        [u_max * T / X / 10**1.5, u_max * T / X * 10**1.5]
    )


def test_new_law_has_its_colour_or_one_that_nobody_else_has(found):
    assert found["brand_new"]["colour"] == "#102030"
    assert found["brand_new"]["colours"].count("#102030") == 1
    every = found["plain_one"]["colours"]
    assert len(set(every)) == len(every)
