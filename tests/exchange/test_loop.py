"""Folders around exported laws compile without a warning, under sanitizers, and command what a run
does, to the last bit.
"""

import io
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exchange.helpers.compiler import needs_compiler
from helpers.pages import ROOT

import smc_mujoco as smc
from smc_mujoco.exchange.c import build
from smc_mujoco.exchange.loop.package import law_to_package
from smc_mujoco.simulation.readings import readings

STUBS = ROOT / "tests" / "exchange" / "ros2_control"
HEADERS = (
    "controller_interface/controller_interface.hpp",
    "pluginlib/class_list_macros.hpp",
    "std_msgs/msg/float64_multi_array.hpp",
)
STRICT = ["-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-I."]
SANITIZED = [*STRICT, "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
CASES = {
    "super_twisting": {"law": smc.law("super_twisting", k1=5.0, k2=8.0)},
    "adrc": {"law": smc.law("adrc", wc=8.0, w=20.0, b=1.0)},
    "an estimator": {"law": smc.law("pid", kp=20.0, kd=3.0), "velocity": "levant"},
    "compensation": {
        "law": smc.law("pid", kp=20.0, kd=3.0),
        "friction": smc.Coulomb(0.3),
        "feedforward": smc.Feedforward(smc.Coulomb(0.3), on="speed", eps=0.05),
    },
}
LOADED = smc.Coulomb(0.1, km=0.2), smc.Viscous(0.1)
PLAY = smc.Backlash(0.02, rotor_inertia=5e-3, rotor_damping=0.1)
CASES |= {
    "a loss that grows with the load": {
        "law": smc.law("pid", kp=20.0, kd=3.0),
        "friction": LOADED,
        "feedforward": smc.Feedforward(LOADED, on="speed", eps=0.05),
    },
    "a play": {
        "law": smc.law("pid", kp=20.0, kd=1.0),
        "actuator": PLAY,
        "sensor": smc.Encoder(4096, side="motor"),
        "velocity": "levant",
        "reference": smc.Sine(0.2, 6.0),
        "feedforward": smc.Feedforward((smc.Coulomb(0.1), PLAY), eps=0.05),
    },
}
needs_cpp = pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler here")


def scenario_of(case):
    fields = {"reference": smc.Constant(0.2)} | CASES[case]
    return smc.Scenario(plant="duffing", u_max=9.0, x0=0.3, duration=0.3, **fields)


def references(scenario, trace):
    """r, r' and r'' at each sample, (K + 1, 3)."""
    signal = scenario.resolved.references[0]
    return np.array([type(signal).value(t, signal) for t in trace.t])


def rows(scenario, trace, inputs):
    """A line for each sample, as a loop reads them."""
    r, dr, ddr = references(scenario, trace).T
    columns = {"x": readings(trace)[:, 0], "v": trace.v[:, 0], "r": r, "dr": dr, "ddr": ddr}
    seen = io.StringIO()
    np.savetxt(seen, np.column_stack([columns[name] for name in inputs]), "%.17g")
    return seen.getvalue()


@needs_compiler
@pytest.mark.parametrize("case", CASES)
def test_a_plain_loop_commands_what_a_run_does(case, tmp_path):
    scenario = scenario_of(case)
    folder = law_to_package(scenario, tmp_path / "loop", "plain")
    sources = sorted(path.name for path in folder.glob("*.c"))
    compiler = build.compiler()[0]
    command = [compiler, "-std=c99", *SANITIZED, *sources, "-o", "main", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    trace = smc.run(scenario)
    (inputs,) = re.findall(r"inputs\[\] = \{(.*?)\}", (folder / "main.c").read_text())
    done = subprocess.run(
        folder / "main",
        input=rows(scenario, trace, re.findall(r"\w+", inputs)),
        capture_output=True,
        text=True,
        check=True,
    )
    np.testing.assert_array_equal(np.array(done.stdout.split(), float), trace.u[:, 0])
    assert len(np.unique(trace.u)) > 50


@needs_compiler
@needs_cpp
@pytest.mark.parametrize("case", [pytest.param(case, marks=pytest.mark.slow) for case in CASES])
def test_a_package_for_ros2_control_commands_what_a_run_does(case, tmp_path):
    scenario = scenario_of(case)
    folder = law_to_package(scenario, tmp_path / "My controller", "ros2")
    source = folder / "src"
    for header in HEADERS:
        (source / header).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(STUBS / "stubs.hpp", source / header)
    shutil.copy(STUBS / "main.cpp", source)
    in_c = sorted(path.name for path in source.glob("*.c"))
    compiler = build.compiler()[0]
    subprocess.run([compiler, "-std=c99", *SANITIZED, "-c", *in_c], cwd=source, check=True)
    objects = [Path(name).with_suffix(".o").name for name in in_c]
    in_cpp = ["smc_controller.cpp", "main.cpp"]
    command = ["g++", "-std=c++17", *SANITIZED, *in_cpp, *objects, "-o", "main"]
    subprocess.run(command, cwd=source, check=True)
    trace = smc.run(scenario)
    names = _inputs(source)
    speeds = "v" in names
    seen = io.StringIO()
    moved = references(scenario, trace)
    lines = np.column_stack([trace.t, readings(trace)[:, 0], trace.v[:, 0], moved])
    np.savetxt(seen, np.tile(lines, (2, 1)), "%.17g")
    done = subprocess.run(
        source / "main", input=seen.getvalue(), capture_output=True, text=True, check=True
    )
    interfaces, *commands = done.stdout.splitlines()
    expected = ["joint1/effort", "joint1/position", *(["joint1/velocity"] if speeds else [])]
    assert interfaces.split() == expected
    np.testing.assert_array_equal(np.array(commands, float), np.tile(trace.u[:, 0], 2))
    package = (folder / "package.xml").read_text()
    assert "<name>my_controller</name>" in package
    parameters = (folder / "config" / "controllers.yaml").read_text()
    assert "u_max: 9.0" in parameters
    for name, value in scenario.law.gains.items():
        if np.isfinite(value):
            assert f"{name}: {float(value)!r}" in parameters


def _inputs(source):
    """The inputs of a controller, by their names."""
    text = (source / "controller.c").read_text()
    return re.findall(r'\{"(\w+)", SMC_INPUT', text)


@pytest.mark.quick
def test_a_law_that_reads_a_model_is_refused(tmp_path, refused):
    refused(lambda: law_to_package("computed_torque_sliding", tmp_path / "a", joints=2), "M", ".c")


def test_the_package_names_the_joints_that_its_file_names(tmp_path):
    xml = """<mujoco><worldbody><body><joint name="left/elbow" axis="0 1 0"/><geom size=".1"/></body>
    </worldbody><actuator><motor joint="left/elbow" ctrlrange="-1 1"/></actuator></mujoco>"""
    arm = smc.plant_from(xml, ["left/elbow"], name="arm")
    for plant, names in ((arm, '["left/elbow"]'), ("duffing", "[joint1]")):
        scenario = smc.Scenario(plant=plant, law="super_twisting")
        folder = law_to_package(scenario, tmp_path / "a", "ros2")
        parameters = (folder / "config" / "controllers.yaml").read_text()
        assert f"joints: {names}\n" in parameters
