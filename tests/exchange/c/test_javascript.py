"""Laws, surfaces and estimators in JavaScript: each gives the numbers of its Python; what has none is said."""

import json
import math
import random
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.live import READ, node

import smc_mujoco as smc
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control import estimator, surface
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.law import Measurement, catalogue
from smc_mujoco.exchange.c.javascript import to_js

TENTHS = 0.1, 0.2, 0.3
CALLS = 40  # of each component, with random measurements and one memory
SCRIPT = """
import fs from "node:fs";
import { components } from "./components.js";
const given = read(fs.readFileSync(0, "utf8"));
const results = {};
for (const [name, { gains, memory, measurements }] of Object.entries(given)) {
  const held = new Float64Array(memory);
  results[name] = measurements.map((y) => { const out = [0, 0]; components[name](y, gains, held, out); return out; });
}
console.log(JSON.stringify(results));
"""


def measured(rng: random.Random, k: int) -> dict[str, float]:
    """A measurement: with the model and without, with a surface and without, at rest and far from it."""
    y = {name: rng.gauss(0.0, 1.0) for name in Measurement._fields}
    y |= {"t": 1e-3 * k, "dt": 1e-3, "g": 2.0, "limit": 6.0, "model": float(k % 2), "has_surface": float(k % 3 == 0)}
    return y | ({"e": 0.0, "de": 0.0} if k % 7 == 0 else {})


def outputs(component, y, gains, memory) -> tuple[float, float]:
    """The two results of a component's Python; NaN for the acceleration of an estimator that gives none."""
    found = rebuild(component.function, lambda plain: plain)(
        (Reading(y["dt"], y["x"], y["v"]) if component.kind == "estimator" else Measurement(**y)), gains, memory
    )
    first, second = found if isinstance(found, tuple) else (found, math.nan)
    return float(first), float(second)


def compared(components, tmp_path) -> dict[str, float]:
    """The largest relative difference between the JavaScript of each component and its Python."""
    given, expected, rng = {}, {}, random.Random(1)
    for one in components:
        memory, rows = np.zeros(one.memory), [measured(rng, k) for k in range(CALLS)]
        gains = SimpleNamespace(**one.gains)
        expected[one.name] = [outputs(one, y, gains, memory) for y in rows]
        given[one.name] = {"gains": list(one.gains.values()), "memory": one.memory, "measurements": rows}
    entries = ",\n".join(f"{json.dumps(one.name)}: {to_js(one)}" for one in components)
    (tmp_path / "components.js").write_text(f"export const components = {{{entries}}};")
    found = node(READ + SCRIPT, tmp_path, given)
    differences = {}
    for name, rows in expected.items():
        pairs = zip(np.ravel(np.array(found[name], float)), np.ravel(rows), strict=True)  # JSON has null for NaN
        alike = [(a, b) for a, b in pairs if not (math.isnan(a) and math.isnan(b))]
        differences[name] = max(abs(a - b) / (1.0 + abs(b)) for a, b in alike)
    return differences


def test_every_law_gives_the_numbers_of_its_python(tmp_path):
    laws = [template() for name, template in catalogue().items() if name != "observer_free_single"]
    found = compared(laws, tmp_path)
    assert len(found) > 40
    assert {name: difference for name, difference in found.items() if not difference < 1e-13} == {}


@pytest.mark.parametrize("known", [surface.catalogue, estimator.catalogue])
def test_every_surface_and_estimator_gives_the_numbers_of_its_python(tmp_path, known):
    found = compared([template() for template in known().values()], tmp_path)
    assert len(found) >= 8
    assert {name: difference for name, difference in found.items() if not difference < 1e-13} == {}


def test_names_that_only_javascript_reserves_are_kept_apart(tmp_path):
    @smc.law_function(gains={"let": 2.0, "var": 3.0}, memory=1)
    def odd(y, gains, memory):
        new, function = y.e * gains.let, gains.var
        null, Math = (new, function) if new > 0.0 else (function, -new)
        memory[0] += null
        return math.fmod(memory[0], 2.0) - Math, math.copysign(new, -y.de)

    assert compared([odd()], tmp_path)["odd"] == 0.0


def test_whole_numbers_and_loops_are_as_in_python(tmp_path):
    @smc.law_function(gains={"k": 2.0}, memory=2)
    def counted(y, gains, memory):
        total = 0.0
        for i in range(1, 4):
            total += y.e / (i + 1)
        place = int(y.x * 10.0)
        return total + (place & 3) + TENTHS[(place & 1) - 1], math.floor(y.v) * gains.k

    assert compared([counted()], tmp_path)["counted"] < 1e-14


@pytest.mark.parametrize(
    ("law", "sentence"),
    [
        (lambda: smc.law("observer_free_single"), "numbers of 32 bits"),
        (lambda: smc.law("classical", k=[1.0, 2.0]), "is of several joints"),
        (lambda: smc.law("computed_torque_sliding"), "is of several joints"),
    ],
)
def test_a_law_without_javascript_says_why(law, sentence):
    with pytest.raises(smc.ScenarioError, match=sentence):
        to_js(law())


def test_a_law_that_keeps_arrays_is_refused():
    """It has a translation into C, of which JavaScript would not read the arrays."""

    @smc.law_function(memory=3)
    def keeps(y, gains, memory):
        last = memory[1:]
        last[0] = y.e
        return -y.de, last[0]

    @smc.law_function
    def pairs(y, gains, memory):
        both = y.e, y.de
        return -both[0], both[1]

    for law in (keeps(), pairs()):
        with pytest.raises(
            smc.ScenarioError, match=f"law '{law.name}' keeps arrays or tuples, which are not written in J"
        ):
            to_js(law)


def test_a_law_that_calls_a_library_is_quoted():
    @smc.law_function(gains={"k": 2.0})
    def reads(y, gains, memory):
        return np.sinc(y.e), y.e

    with pytest.raises(smc.ScenarioError, match=r"cannot be written in JavaScript: .*sinc"):
        to_js(reads())
