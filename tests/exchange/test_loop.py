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
needs_cpp = pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler here")


def scenario_of(case):
    reference = smc.Constant(0.2)
    return smc.Scenario(
        plant="duffing", reference=reference, u_max=9.0, x0=0.3, duration=0.3, **CASES[case]
    )


def rows(trace, speeds, reference):
    """A line for each sample: t, x, v, r, as a loop reads them."""
    columns = [trace.x, trace.v] if speeds else [trace.x]
    if reference:
        columns.append(trace.r)
    seen = io.StringIO()
    np.savetxt(seen, np.hstack(columns), "%.17g")
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
        input=rows(trace, '"v"' in inputs, True),
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
    speeds = "v" in _inputs(source)
    seen = io.StringIO()
    np.savetxt(seen, np.tile(np.c_[trace.t, trace.x, trace.v], (2, 1)), "%.17g")
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


def test_a_law_that_reads_a_model_is_refused(tmp_path, refused):
    refused(lambda: law_to_package("computed_torque_sliding", tmp_path / "a", joints=2), "M", ".c")
