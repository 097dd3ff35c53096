"""Laws of free bodies in C: written out, they give the compiled law's bits."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers.compiler import needs_compiler

import smc_mujoco as smc
from smc_mujoco.cli import main as cli
from smc_mujoco.control.joint_law import catalogue
from smc_mujoco.control.law import FREE_BODY
from smc_mujoco.exchange.c import export, sandbox

pytestmark = needs_compiler

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wmissing-prototypes")
LAWS = [name for name, law in catalogue().items() if FREE_BODY in law.plants]
WIND = (smc.signals.Wind(3.0), smc.signals.Dryden(w20=15.0, speed=3.0))


def scenarios(law) -> list[smc.Scenario]:
    """Of the library's quadrotor, along a path in turbulence, and of a drone of one's own, which starts turned."""
    drone = smc.plant_from("examples/quadrotor.xml", channels=["body"], keyframe="hover")
    common = {"law": law, "noise": smc.Noise(1e-3, 1e-2), "duration": 0.4}
    return [
        smc.Scenario(plant="quadrotor", disturbance=WIND, reference=smc.Sine(0.2, 3.0), **common),
        smc.Scenario(plant=drone, x0=(0.3, 0.2, 1.0, 0.1, 0.2, 2.5), v0=(0.0, 0.0, 0.0, 3.0, 0.0, 2.0), **common),
    ]


@pytest.fixture(scope="module")
def traces(tmp_path_factory):
    """Law -> pairs of traces, of the law and of its C, compiled without a warning."""
    folder = tmp_path_factory.mktemp("flight")

    def make(name: str):
        (path := folder / f"{name}.c").write_text(smc.exchange.law_to_c(name))
        return smc.exchange.law_from_c(path, flags=STRICT, timeout=60.0, name=f"c {name}")

    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(2) as pool:
        patch.setattr(export, "_measured", lambda code: "not measured")
        patch.setattr(sandbox, "load", lambda law: sandbox.facts(sandbox.entry(str(law.file), law.symbol)[1]))
        made = [*pool.map(make, LAWS)]
    found = iter(smc.run([s for pair in zip(LAWS, made, strict=True) for law in pair for s in scenarios(law)]))
    return {name: [*zip(*[[next(found), next(found)] for _ in "12"], strict=True)] for name in LAWS}


@pytest.mark.parametrize("name", LAWS)
def test_a_law_of_flight_written_out_gives_its_own_trace_to_the_last_bit(traces, name):
    assert [ours.scenario.resolved.plant.name for ours, _ in traces[name]] == ["quadrotor", "quadrotor.xml"]
    for ours, theirs in traces[name]:
        assert ours.failure is theirs.failure is None
        for field in ("x", "v", "u", "s", "applied"):
            np.testing.assert_array_equal(getattr(theirs, field), getattr(ours, field))
        assert len(np.unique(ours.u, axis=0)) > 300


def test_a_trial_in_a_process_of_its_own_finds_nothing_wrong(tmp_path, capsys):
    (path := tmp_path / "tried.c").write_text(smc.exchange.law_to_c("indi_attitude"))
    with pytest.raises(SystemExit) as end:
        cli.main(["list", str(path)])
    assert not end.value.code
    assert "tried.c: smc_law passes; 6 joints; gains kx = 2, " in capsys.readouterr().out.splitlines()[-1]


def test_a_law_of_a_free_body_has_no_other_number_of_joints():
    with pytest.raises(smc.ScenarioError, match="law 'geometric' is of a free body, of 6 joints: leave joints=7 out"):
        smc.exchange.law_to_c("geometric", joints=7)
