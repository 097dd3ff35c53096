"""The skeleton for ROS 2 compiles against stubs of ROS, and commands what a run does."""

import shutil
import subprocess

import numpy as np
import pytest
from helpers.compiler import needs_compiler
from helpers.pages import ROOT

import smc_mujoco as smc
from smc_mujoco.exchange.c import build

STUBS = ROOT / "tests" / "exchange" / "ros2_control"
HEADERS = (
    "controller_interface/controller_interface.hpp",
    "pluginlib/class_list_macros.hpp",
    "std_msgs/msg/float64.hpp",
)


@needs_compiler
@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler here")
def test_the_controller_for_ros_2_commands_what_a_run_does(tmp_path):
    law = smc.law("super_twisting", k1=5.0, k2=8.0)
    for header in HEADERS:
        (tmp_path / header).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(STUBS / "stubs.hpp", tmp_path / header)
    (tmp_path / "super_twisting.c").write_text(smc.exchange.law_to_c(law))
    shutil.copy(ROOT / "examples" / "controller.c", tmp_path)
    exact = (*build.compiler(), "-ffp-contract=off", "-c", "controller.c")
    subprocess.run(exact, cwd=tmp_path, check=True)
    source = ROOT / "examples" / "ros2_control" / "src" / "smc_controller.cpp"
    strict = ("g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-I.")
    files = (source, STUBS / "main.cpp", "controller.o", "-o", "main")
    subprocess.run([*strict, *map(str, files)], cwd=tmp_path, check=True)
    trace = smc.run(smc.Scenario(plant="duffing", law=law, u_max=6.0, duration=0.5))
    seen = "\n".join(f"{t!r} {x!r} {v!r}" for t, x, v in np.c_[trace.t, trace.x, trace.v].tolist())
    done = subprocess.run(tmp_path / "main", input=seen, capture_output=True, text=True, check=True)
    interfaces, *commands = done.stdout.splitlines()
    assert interfaces.split() == ["elbow/effort", "elbow/position", "elbow/velocity"]
    np.testing.assert_array_equal(np.array(commands, float), trace.u[:, 0])
