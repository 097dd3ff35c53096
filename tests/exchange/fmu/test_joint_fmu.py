"""Laws of many joints as FMUs: valid by FMPy, and step by step what smc.run computes."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy", reason="FMPy, pip install 'smc-mujoco[fmu]', is not installed")

from exchange.helpers.compiler import needs_compiler  # noqa: E402
from exchange.helpers.flights import recorded, scenarios  # noqa: E402
from exchange.helpers.fmu import Importer  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402
from helpers import arms  # noqa: E402
from helpers.python_controller import Controller  # noqa: E402

import smc_mujoco as smc  # noqa: E402
from smc_mujoco.cli import main as cli  # noqa: E402
from smc_mujoco.control.joint_law import coriolis, jacobian  # noqa: E402
from smc_mujoco.exchange.c import build  # noqa: E402

pytestmark = needs_compiler

REFERENCE = smc.Sine(0.2, 5.0)
JOINTS = (1, 2, 3)
# Law -> what its scenario has besides: every law once, with and without the model, with an
# estimator, with own bounds.
CASES = {name: {"model": "nominal"} for name in arms.LAWS} | {
    "time_delay_sliding": {"velocity": "levant", "v0": (0.1, -0.2, 0.3)},
    "observer_free_joint": {"velocity": "extended_state_observer", "u_max": (3.0, 1.5, 2.0)},
}
GAINS = {
    "computed_torque_sliding": {"k": [10.0, 20.0, 5.0]},
    "unit_vector": {"rho": 8.0},
}


def scenario(name: str, **fields) -> smc.Scenario:
    common = {
        "plant": arms.arm(),
        "duration": 0.1,
        "reference": REFERENCE,
        "x0": (0.1, -0.3, 0.2),
        "u_max": 60.0,
    }
    return smc.Scenario(law=smc.law(name, **GAINS.get(name, {})), **common | CASES[name] | fields)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("joint_fmu")


@pytest.fixture(scope="module")
def made(folder):
    """Law -> its FMU, compiled in a third of the time without optimisation, and its trace."""
    scenarios = [scenario(name) for name in CASES]
    with ThreadPoolExecutor(2) as pool, pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "LIBRARY_FLAGS", ("-O0", *build.LIBRARY_FLAGS[1:]))
        paths = list(
            pool.map(lambda s: smc.exchange.law_to_fmu(s, folder / f"{s.law.name}.fmu"), scenarios)
        )
        return dict(zip(CASES, zip(paths, smc.run(scenarios), strict=True), strict=True))


def seen(known, controller: Controller, trace: smc.Trace, k: int) -> dict[str, float]:
    """The inputs of an FMU at a sample of a trace without noise: what the controller's law
    reads.
    """
    motion = np.repeat(np.transpose([type(REFERENCE).value(trace.t[k], REFERENCE)]), 3, axis=1)
    y = controller.joint_measurement(trace.x[k], trace.v[k], trace.t[k], motion)
    vectors = {name: getattr(y, name) for name in ("x", "v", "r", "dr", "ddr", "h", "g")}
    values = {}
    for name, vector in vectors.items():
        for i in JOINTS:
            values[f"{name}[{i}]"] = float(vector[i - 1])
    matrices = {"M": y.M, "C": np.column_stack([coriolis(y, unit) for unit in np.eye(3)])}
    if "J[1,1]" in known:
        matrices["J"] = jacobian(y)
    values |= {
        f"{name}[{i},{j}]": float(m[i - 1, j - 1])
        for name, m in matrices.items()
        for i in JOINTS
        for j in JOINTS
    }
    return {name: value for name, value in values.items() if name in known}


def outputs(fmu: Importer) -> list[float]:
    return fmu.get(*(f"{name}[{i}]" for name in "us" for i in JOINTS))


def stepped(fmu: Importer, trace: smc.Trace, samples: int) -> np.ndarray:
    """u and s after each step, (samples, 6)."""
    rows = []
    controller = Controller(trace.scenario)
    for k in range(samples):
        fmu.set(**seen(fmu.at, controller, trace, k))
        fmu.fmu.doStep(trace.t[k], 1e-3)
        rows.append(outputs(fmu))
    return np.array(rows)


@pytest.mark.parametrize("name", CASES)
def test_an_fmu_gives_what_a_run_gives(made, folder, name):
    """To the last bit; but C w is a product here, where smc.run asks MuJoCo for it, so that 1e-12
    remains.
    """
    path, trace = made[name]
    assert trace.failure is None
    assert validate_fmu(str(path)) == []
    fmu = Importer(path, folder / name)
    u_and_s = stepped(fmu, trace, len(trace.t))
    expected = np.hstack([trace.u, trace.s])
    assert fmu.said == []
    assert len(np.unique(u_and_s, axis=0)) > 50
    if name == "passivity_based":
        assert np.abs(u_and_s - expected).max() <= 1e-12 * np.abs(expected).max()
    else:
        np.testing.assert_array_equal(u_and_s, expected)


@pytest.mark.quick
@pytest.mark.parametrize("name", CASES)
def test_its_inputs_are_those_that_the_law_reads(made, name):
    read = {
        "computed_torque_sliding": "x v r dr ddr M h",
        "hybrid_sliding": "x v r dr ddr M h J",
        "observer_free_joint": "x r dr",
        "passivity_based": "x v r dr ddr M h C",
        "super_twisting_computed_torque": "x v r dr ddr M h",
        "time_delay_sliding": "x r dr ddr",
        "unit_vector": "x v r dr ddr M h",
    }[name]
    variables = {v.name: v for v in fmpy.read_model_description(str(made[name][0])).modelVariables}
    inputs = set()
    for input_name, v in variables.items():
        if v.causality == "input":
            inputs.add(input_name.partition("[")[0])
    assert inputs == set(read.split())
    assert [n for n, v in variables.items() if v.causality == "output"] == [
        f"{n}[{i}]" for n in "us" for i in JOINTS
    ]


def test_gains_and_bounds_are_those_of_the_joints_and_change_while_it_runs(made, folder):
    path, trace = made["computed_torque_sliding"]
    fmu = Importer(path, folder / "computed_torque_sliding")
    assert fmu.get("law.k[1]", "law.k[2]", "law.k[3]", "law.c[2]") == [10.0, 20.0, 5.0, 5.0]
    before = stepped(fmu, trace, 3)
    changed = Importer(
        path, folder / "computed_torque_sliding", **{"law__c[2]": 9.0, "u_max[3]": 0.25}
    )
    after = stepped(changed, trace, 3)
    same = np.all(before == after, axis=0)
    assert same[3:].tolist() == [True, False, True]  # s of the joint whose slope has changed
    np.testing.assert_array_equal(np.abs(after[:, 2]), np.minimum(np.abs(after[:, 2]), 0.25))
    shared = Importer(made["unit_vector"][0], folder / "unit_vector")
    assert (shared.get("law.rho"), "law.rho[1]" in shared.at) == ([8.0], False)
    own = Importer(made["observer_free_joint"][0], folder / "observer_free_joint")
    assert own.get("u_max[1]", "u_max[2]", "u_max[3]") == [3.0, 1.5, 2.0]
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        own.set(**{"u_max[2]": 0.0})
    assert "u_max[2] = 0 is out of its range" in own.said[-1]


def test_each_joint_has_a_memory_of_its_own(made, folder):
    path, trace = made["time_delay_sliding"]
    fmu = Importer(path, folder / "time_delay_sliding")
    stepped(fmu, trace, 3)
    slots = []
    for i in JOINTS:
        slots.append(fmu.get(*(f"law.memory[{i},{k}]" for k in (1, 2, 3))))
    np.testing.assert_array_equal([memory[0] for memory in slots], trace.u[2])
    assert [memory[2] for memory in slots] == [1.0] * 3
    estimates = fmu.get(*(f"v_estimated[{i}]" for i in JOINTS))
    assert [memory[1] for memory in slots] == estimates
    assert len(set(estimates)) == 3


def test_an_fmu_of_a_free_body_gives_the_actuators_their_controls(tmp_path):
    """In wind and noise, from what the law measured there; the errors of the pose are its own."""
    of_run = scenarios("adaptive_quaternion_sliding")[0]
    trace, read = recorded(of_run, tmp_path)
    path = smc.exchange.law_to_fmu(of_run, tmp_path / "flight.fmu")
    assert validate_fmu(str(path)) == []
    fmu = Importer(path, tmp_path / "flight")
    axes = range(1, 7)
    inputs = {}
    for name in ("x", "v", "r", "dr", "ddr", "h"):
        for i in axes:
            inputs[f"{name}[{i}]"] = (name, i - 1)
    inputs |= {f"M[{i},{j}]": ("M", i - 1, j - 1) for i in axes for j in axes}
    names = [f"{name}[{i}]" for name in "us" for i in axes] + [f"control[{i}]" for i in range(1, 5)]
    variables = {}
    for v in fmpy.read_model_description(str(path)).modelVariables:
        variables[v.name] = v
    assert {name for name, v in variables.items() if v.causality == "input"} == inputs.keys()
    assert [name for name, v in variables.items() if v.causality == "output"] == names
    rows = []
    for k, t in enumerate(trace.t):
        fmu.set(
            **{name: float(read[field][(k, *place)]) for name, (field, *place) in inputs.items()}
        )
        fmu.fmu.doStep(t, 1e-3)
        rows.append(fmu.get(*names))
    np.testing.assert_array_equal(rows, np.hstack([trace.u, trace.s, trace.applied[:, :4]]))
    assert len(np.unique(rows, axis=0)) > 300


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: smc.exchange.law_to_fmu("unit_vector", joints=2, surface="linear"),
            "has its own surface",
        ),
        (
            lambda: smc.exchange.law_to_fmu("unit_vector", joints=2, model="none"),
            "needs the nominal model",
        ),
        (
            lambda: smc.exchange.law_to_fmu("unit_vector", joints=3, u_max=[1.0, 2.0]),
            "u_max has 2 values for 3 joints",
        ),
        (
            lambda: smc.exchange.law_to_fmu("unit_vector", joints=2, u_max=[1.0, -2.0]),
            r"u_max\[1\] is -2",
        ),
        (
            lambda: smc.exchange.law_to_fmu("pid", joints=2),
            "law 'pid' is of one channel: leave joints=2 out",
        ),
        (
            lambda: smc.exchange.law_to_fmu(scenario("unit_vector"), joints=3),
            "a scenario has its own joints",
        ),
    ],
)
def test_what_cannot_be_an_fmu_is_one_sentence(call, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(smc.ScenarioError, match=said) as error:
        call()
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_the_command_takes_the_number_of_joints(tmp_path, capsys):
    out = tmp_path / "c.fmu"
    with pytest.raises(SystemExit) as end:
        cli.main(["export", "unit_vector", str(out), "--gains", "c=4 6", "--no-binary"])
    assert not end.value.code
    variables = {}
    for v in fmpy.read_model_description(str(out)).modelVariables:
        variables[v.name] = v
    assert [
        float(variables[name].start) for name in ("law.c[1]", "law.c[2]", "M[2,2]", "M[1,2]")
    ] == [
        4.0,
        6.0,
        1.0,
        0.0,
    ]
    with pytest.raises(SystemExit) as end:
        cli.main(["export", "unit_vector.fmu"])
    assert end.value.code == 2
    said = "smc-mujoco: law 'unit_vector' is of many joints: give their number, such as joints=7\n"
    assert capsys.readouterr().err == said
