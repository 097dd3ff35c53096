"""Every public function says what comes back and shows a call, and the call runs."""

import inspect
import re
import textwrap
import warnings

import numpy as np
import pytest
from helpers import annexes

import smc_mujoco as smc

ROOMS = annexes.here(["accuracy", "design", "envs", "exchange", "hardware", "metrics", "signals"])
ARM = """<mujoco><worldbody><body><joint name="shoulder" axis="0 1 0" damping=".1"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1"/><body pos="0 0 -.4">
<joint name="elbow" axis="0 1 0" damping=".1"/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass=".5"/>
</body></body></worldbody><actuator><motor joint="shoulder" ctrlrange="-20 20"/>
<motor joint="elbow" ctrlrange="-10 10"/></actuator></mujoco>"""
PERSONAL = {  # calls that need a person, a paper of one's own, another package's object or hours
    "smc.audit": "a paper of one's own",
    "smc.claims": "all claims of a paper take minutes",
    "smc.envs.agent": "an environment that the reader has made",
    "smc.exchange.law_from_c": "a file of the reader's",
    "smc.exchange.law_from_fmu": "a file of the reader's",
    "smc.law_from": "a controller of the reader's",
    "smc.play": "a scene's own file",
    "smc.results": "results of the reader's entries",
    "smc.show": "a notebook",
    "smc.view": "a browser, until Ctrl-C",
}


def everything():
    """Address -> function, class or module, of all that is public."""
    objects = {}
    for name in smc.__all__:
        objects[f"smc.{name}"] = getattr(smc, name)
    for room in ROOMS:
        for name in getattr(smc, room).__all__:
            objects[f"smc.{room}.{name}"] = getattr(getattr(smc, room), name)
    return objects


def example(function) -> str:
    """The code that a docstring shows."""
    blocks = re.findall(r"\n\n((?: {4}.*\n?|\n(?= {4}))+)", inspect.getdoc(function) or "")
    return "\n".join(map(textwrap.dedent, blocks))


EVERYTHING = everything()
PUBLIC = {
    name: public_object
    for name, public_object in EVERYTHING.items()
    if inspect.isfunction(public_object)
}


@pytest.mark.quick
@pytest.mark.parametrize("name", PUBLIC)
def test_a_function_says_what_comes_back(name):
    said = inspect.getdoc(PUBLIC[name])
    annotation = inspect.signature(PUBLIC[name]).return_annotation
    assert said is not None
    assert annotation in (None, "None") or "\nReturns:\n" in said


def test_help_sends_nobody_to_a_file_of_the_checkout():
    files = re.compile(r"\b(?:docs|tests|benchmarks)/|\b(?:see|in) \w+\.py\b")
    files_named = {
        name: files.findall(inspect.getdoc(public_object) or "")
        for name, public_object in EVERYTHING.items()
    }
    assert not {name: names for name, names in files_named.items() if names}


@pytest.mark.parametrize("kind", ["law", "joint", "surface", "estimator"])
def test_the_page_of_a_component_names_its_gains_as_help_says(kind):
    """`print(smc.law(name).template.doc)` is where `help` sends."""
    maker = {"surface": smc.surface, "estimator": smc.estimator}.get(kind, smc.law)
    for name in smc.laws(kind=kind):
        component = maker(name)
        assert component.template is not None
        for gain in component.gains:
            assert re.search(rf"\b{gain}\b", component.template.doc), (name, gain)


def test_calls_that_no_test_runs_are_those_that_need_the_reader():
    present = [name for name in PERSONAL if annexes.here([name.removeprefix("smc.")])]
    assert set(present) <= set(PUBLIC)


@pytest.mark.parametrize("name", [name for name in PUBLIC if name not in PERSONAL])
def test_the_call_that_a_docstring_shows_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(ARM)
    code = example(PUBLIC[name])
    if annexes.lacking(code):
        pytest.skip("it uses an annex that is missing")
    assert f"{name}(" in code or f"@{name}" in code
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", smc.errors.PlainLoopWarning
        )  # of a law that is not compiled
        exec(compile(code, name, "exec"), {"smc": smc, "np": np})
