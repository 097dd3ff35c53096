"""Laws of free bodies in C: written out, they give the compiled law's bits, also on their own."""

import subprocess

import numpy as np
import pytest
from exchange.helpers.compiler import needs_compiler
from exchange.helpers.flights import MEASUREMENT, recorded, scenarios

import smc_mujoco as smc
from smc_mujoco.control.law import FREE_BODY, joint_law_catalogue
from smc_mujoco.exchange.c import build
from smc_mujoco.mechanisms.rotation import quaternion, rotation_vector

pytestmark = needs_compiler

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wmissing-prototypes")
LAWS = [name for name, law in joint_law_catalogue().items() if FREE_BODY in law.plants]
# Firmware: reads quaternions and measurements, of which it computes the errors itself.
FIRMWARE = """#include "law.c"
#include <stdio.h>
#include <string.h>

int main(void)
{
    static double memory[SMC_JOINTS * SMC_LAW_MEMORY];
    double q[7], x[6], out[2 * SMC_JOINTS], controls[SMC_ACTUATORS];
    smc_measurement y;
    while (fread(q, sizeof q, 1, stdin) && fread(&y, sizeof y, 1, stdin)) {
        memset(y.e, 0, sizeof y.e), memset(y.de, 0, sizeof y.de);
        smc_pose(q, x);
        smc_errors(y.x, y.v, y.r, y.dr, y.e, y.de);
        if (smc_law(&y, smc_law_defaults, memory, out)) return 1;
        smc_actuators(&y, out, controls);
        fwrite(x, sizeof x, 1, stdout), fwrite(out, sizeof out, 1, stdout);
        fwrite(controls, sizeof controls, 1, stdout), fwrite(y.e, sizeof y.e + sizeof y.de, 1, stdout);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def traces(tmp_path_factory):
    """Law -> pairs of traces, of the law and of its C, compiled without a warning."""
    folder = tmp_path_factory.mktemp("flight")

    def make(name: str):
        (path := folder / f"{name}.c").write_text(smc.exchange.law_to_c(name))
        return smc.exchange.law_from_c(path, flags=STRICT, timeout=60.0, name=f"c {name}")

    laws_from_c = [*map(make, LAWS)]
    runs = iter(
        smc.run(
            [
                s
                for pair in zip(LAWS, laws_from_c, strict=True)
                for law in pair
                for s in scenarios(law)
            ]
        )
    )
    return {name: [*zip(*[[next(runs), next(runs)] for _ in "12"], strict=True)] for name in LAWS}


@pytest.mark.parametrize("name", LAWS)
def test_a_law_of_flight_written_out_gives_its_own_trace_to_the_last_bit(traces, name):
    assert [ours.scenario.resolved.plant.name for ours, _ in traces[name]] == [
        "quadrotor",
        "quadrotor.xml",
    ]
    for ours, theirs in traces[name]:
        assert ours.failure is theirs.failure is None
        for field in ("x", "v", "u", "s", "applied"):
            np.testing.assert_array_equal(getattr(theirs, field), getattr(ours, field))
        assert len(np.unique(ours.u, axis=0)) > 300


@pytest.mark.parametrize("of", [0, 1], ids=["quadrotor", "own drone"])
def test_firmware_gives_what_a_run_gives_from_what_was_measured_there(tmp_path, of):
    """Force, torque, s and the actuators' controls, in wind and noise, to the last bit."""
    trace, read = recorded(scenarios("adaptive_quaternion_sliding")[of], tmp_path)
    (tmp_path / "firmware.c").write_text(FIRMWARE)
    flags = [*STRICT, "-O2", "-ffp-contract=off"]
    subprocess.run(
        [*build.compiler(), *flags, "firmware.c", "-o", "firmware", "-lm"], cwd=tmp_path, check=True
    )
    samples = np.zeros(len(read), [("q", "f8", (7,)), ("y", MEASUREMENT)])
    samples["q"] = [
        (*x[:3], *np.multiply((1.0, -1.0)[k % 2], quaternion(*x[3:])))
        for k, x in enumerate(read["x"])
    ]
    samples["y"] = read
    done = subprocess.run(
        [tmp_path / "firmware"], input=samples.tobytes(), capture_output=True, check=True
    )
    numbers = np.frombuffer(done.stdout).reshape(len(trace.t), 34)
    x, u, s, controls, errors = np.split(numbers, [6, 12, 18, 22], axis=1)
    np.testing.assert_array_equal(errors, np.hstack([read["e"], read["de"]]))
    np.testing.assert_array_equal(x, [(*q[:3], *rotation_vector(*q[3:])) for q in samples["q"]])
    np.testing.assert_array_equal(np.clip(u, -read["limit"], read["limit"]), trace.u)
    np.testing.assert_array_equal(s, trace.s)
    np.testing.assert_array_equal(controls, trace.applied[:, :4])
    assert len(np.unique(controls, axis=0)) > 100


@pytest.mark.quick
@pytest.mark.parametrize(
    ("law", "said"),
    [
        ("geometric", "law 'geometric' is of a free body, of 6 joints: leave joints=7 out"),
        (
            smc.Scenario(plant="quadrotor", law="geometric"),
            "a scenario has its own joints: leave joints out",
        ),
    ],
)
def test_another_number_of_joints_is_refused(law, said):
    with pytest.raises(smc.ScenarioError, match=said):
        smc.exchange.law_to_c(law, joints=7)
