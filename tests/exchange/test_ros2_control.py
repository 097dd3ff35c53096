"""The skeleton for ROS 2 compiles against stubs of ROS, and commands what a run does."""

import io
import shutil
import subprocess

import numpy as np
import pytest
from exchange.helpers.compiler import needs_compiler
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
    (tmp_path / "super_twisting.c").write_text(smc.exchange.law_to_c(law))
    for header in HEADERS:
        (tmp_path / header).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(STUBS / "stubs.hpp", tmp_path / header)
    for source in ("controller.c", "ros2_control/src/smc_controller.cpp"):
        shutil.copy(ROOT / "examples" / source, tmp_path)
    shutil.copy(STUBS / "main.cpp", tmp_path)
    strict = "-Wall -Wextra -Werror -ffp-contract=off -I."
    for command in (
        f"{build.compiler()[0]} -c {strict} controller.c",
        f"g++ -std=c++17 {strict} smc_controller.cpp main.cpp controller.o -o main",
    ):
        subprocess.run(command.split(), cwd=tmp_path, check=True)
    still = smc.Constant(0.2)
    trace = smc.run(smc.Scenario(plant="duffing", law=law, reference=still, duration=0.5))
    seen = io.StringIO()
    np.savetxt(seen, np.tile(np.c_[trace.t, trace.x, trace.v], (2, 1)), "%.17g")
    done = subprocess.run(
        tmp_path / "main", input=seen.getvalue(), capture_output=True, text=True, check=True
    )
    interfaces, *commands = done.stdout.splitlines()
    assert interfaces.split() == ["elbow/effort", "elbow/position", "elbow/velocity"]
    np.testing.assert_array_equal(np.array(commands, float), np.tile(trace.u[:, 0], 2))
