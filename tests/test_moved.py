"""Old names of modules: they work for one release, warn of their new place, and hide no public function."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco import moved

ROOT = Path(__file__).parents[1]
FOLDER = Path(moved.__file__).parent
PLACES = {  # old name -> the module that its file names
    ".".join(path.relative_to(FOLDER).with_suffix("").parts).removesuffix(".__init__"): path.read_text().split('"')[1]
    for path in FOLDER.rglob("*.py")
    if path.parent != FOLDER or path.name != "__init__.py"
}
FUNCTIONS = sorted({*PLACES} & {name for name in smc._ORIGINS if callable(getattr(smc, name))})
NAMES = {  # old place -> names in it that the documentation of 0.1 showed
    "actuators": "DCMotor Lag RateLimit",
    "agents": "agent",
    "backlash": "Backlash",
    "basin": "basin",
    "bounds": "SCALES",
    "c.export": "law_to_c",
    "c.load": "law_from_c",
    "claims": "claims Claim lyapunov",
    "cli": "play",
    "component": "GainWarning",
    "conditions": "Jump Noise",
    "contact": "Contact",
    "design": "lqr",
    "differences": "least_difference",
    "draw.figure": "figure",
    "draw.video": "clip film still",
    "errors": "ScenarioError ScenarioWarning",
    "estimators": "estimator estimator_function estimators",
    "friction": "Coulomb LuGre Viscous",
    "grids": "grid",
    "gym": "PlantEnv",
    "initial_states": "starts",
    "law": "Law law law_function laws command sgn sliding",
    "leaderboard": "leaderboard",
    "margins": "margins",
    "mechanism": "deviation",
    "metrics": "score scores",
    "named_conditions": "condition",
    "own_model": "Channel plant_from",
    "paper": "GAINS",
    "plant": "Field Plant plant plants",
    "policies": "policy",
    "pytest_plugin": "golden step_response",
    "references": "MinimumJerk Ramp",
    "report": "report",
    "run": "PlainLoopWarning run stream",
    "scenario": "Scenario",
    "scene": "Scene",
    "sensors": "Encoder",
    "series": "TimeSeries",
    "signals": "BandLimited Constant Gust Impulse OrnsteinUhlenbeck Pulse Signal Sine Step",
    "study": "study",
    "suite": "load",
    "surfaces": "Surface surface surface_function surfaces",
    "table": "Table",
    "theory": "__doc__",
    "trace": "Trace load",
    "tuned": "Tuned",
    "tuning": "compare tune",
    "vector": "BatchEnv",
}
IMPORT_ALL = """
import importlib, json, sys, warnings
found = {}
for place, names in json.loads(sys.argv[1]).items():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            exec(f"from smc_mujoco.{place} import {', '.join(names.split())}")
        except Exception as error:
            found[place] = [repr(error)]
            continue
    found[place] = [str(w.message) for w in caught if w.category is DeprecationWarning and w.filename == "<string>"]
print(json.dumps(found))
"""
CALL_ALL = """
import importlib, sys, warnings
warnings.simplefilter("ignore")
import smc_mujoco as smc
functions = {name: getattr(smc, name) for name in sys.argv[1:]}
for name in functions:
    importlib.import_module("smc_mujoco." + name)
assert smc.law("classical").name == "classical"
assert smc.run([]) == []
assert smc.plant("duffing").name == "duffing"
for name in functions:
    try:
        getattr(smc, name)(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13)
    except smc.ScenarioError as error:
        assert str(error).startswith(name), error
    else:
        raise AssertionError(name)
assert all(getattr(smc, name) is function for name, function in functions.items())
"""


def python(code: str, *arguments: str) -> str:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_documented_names_work_and_warn_of_their_new_place():
    pytest.importorskip("gymnasium")
    pytest.importorskip("dm_control")
    found = json.loads(python(IMPORT_ALL, json.dumps(NAMES)))
    assert found.pop("draw.figure") == []  # where it was
    told = {place: [text.partition(" is now ")[0] for text in texts] for place, texts in found.items()}
    assert {place: [text.removeprefix("smc_mujoco.") for text in texts][:1] for place, texts in told.items()} == {
        place: [{"cli": "cli.play", "metrics": "metrics.score", "c.export": "c", "c.load": "c.load"}.get(place, place)]
        for place in found
    }


def test_every_documented_old_name_has_its_file_and_every_file_its_place():
    assert {*NAMES} - {"cli", "draw.figure", "metrics"} <= {*PLACES}
    for place in PLACES.values():
        assert importlib.util.find_spec(place) is not None


def test_an_old_module_hides_no_public_function():
    assert {"law", "plant", "run", "study", "claims", "report"} <= {*FUNCTIONS}
    python(CALL_ALL, *FUNCTIONS)


def test_public_modules_are_the_new_ones_without_a_warning():
    pytest.importorskip("gymnasium")
    pytest.importorskip("dm_control")
    code = "import warnings; warnings.simplefilter('error'); from smc_mujoco import gym, paper, suite, vector\n"
    code += "print(gym.__name__, paper.__name__, suite.__name__, vector.__name__)"
    told = python(code).split()
    assert told == [PLACES[name] for name in ("gym", "paper", "suite", "vector")]


def test_the_old_name_of_the_pytest_plugin_loads_it(pytester, monkeypatch):
    pytester.makepyfile("def test_it(step_response, golden): step_response('duffing', 'none', step=1, duration=0.01)")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), *sys.path]))
    options = ("-p", "no:smc_mujoco", "-p", "smc_mujoco.pytest_plugin", "--smc-update")
    pytester.runpytest_subprocess(*options).assert_outcomes(passed=1)
