"""The fast engine's code for CUDA, which libnvvm makes without a device."""

import importlib.util
import types

import pytest
from analysis.test_engine_worlds import PLANTS as PLANTS_OF_WORLDS

import smc_mujoco as smc
from smc_mujoco.analysis.engine import group
from smc_mujoco.analysis.engine.scores import engine_metrics
from smc_mujoco.analysis.engine.worlds import WorldGroup
from smc_mujoco.control.law import law_catalogue

with_cuda = pytest.mark.skipif(
    importlib.util.find_spec("numba_cuda") is None,
    reason="numba-cuda is missing: pip install 'smc-mujoco[gpu]'",
)
PLANTS = [
    ("cart_pole", "hierarchical"),
    ("duffing", "pid"),
    ("furuta", "rotary_swing_up"),
    ("inverted_pendulum", "super_twisting"),
    ("inverted_pendulum_network", "super_twisting"),
    ("overhead_crane", "hierarchical"),
    ("pendulum_network", "pid"),
    ("servo_axis", "pid"),
    ("van_der_pol", "pid"),
]
LAWS = [name for name in law_catalogue() if not law_catalogue()[name].plants]
FULL = {
    "noise": smc.Noise(1e-3, 5e-3),
    "input_delay": 3e-3,
    "velocity": "levant",
    "disturbance": (smc.Sine(0.2, 5.0), smc.signals.OrnsteinUhlenbeck(0.1, 0.1)),
    "clock": smc.Clock(missed=0.1),
    "jump": smc.Jump(0.5, {"mass": 2.0}),
    "actuator": smc.Lag(0.01),
    "sensor": smc.Encoder(4096, dropout=0.1, delay=2e-3),
}
DRY = (smc.Coulomb(0.1), smc.Viscous(0.1))
FRICTION = {  # of plants whose joints move alone
    "duffing": smc.hardware.Sigmoid(0.4, 50.0),
    "inverted_pendulum": DRY,
    "pendulum_network": DRY,
}


def code(monkeypatch, plant, law, metrics=("settling_time",), worlds=False, **fields):
    """The code of a run, or of the callback of worlds, for compute capability 9.0."""
    from numba.cuda import dispatcher

    from smc_mujoco.analysis.engine import gpu

    device = types.SimpleNamespace(compute_capability=(9, 0))
    monkeypatch.setattr(dispatcher, "get_current_device", lambda: device)
    case = smc.Scenario(plant=plant, law=law, duration=1.0, **fields)
    if worlds:
        kernel, arguments = gpu.control_kernel(WorldGroup([case], metrics).form), gpu.OF_WORLDS
    else:
        kernel, arguments = gpu.kernel(group.FormGroup([case], metrics).form), gpu.ARGUMENTS
    return gpu.cuda.compile_ptx(kernel, arguments, cc=(9, 0))[0]


@with_cuda
@pytest.mark.slow
@pytest.mark.parametrize(("plant", "law"), PLANTS)
def test_every_plant_compiles_for_a_device_with_all_parts(monkeypatch, plant, law):
    friction = FRICTION.get(plant, ())
    assert ".entry" in code(
        monkeypatch, plant, law, tuple(engine_metrics()), **FULL, friction=friction
    )


@with_cuda
def test_rotors_behind_springs_compile_for_a_device(monkeypatch):
    sprung = {"p1/hinge": smc.hardware.ElasticJoint(900.0)}
    read = smc.Encoder(4096, delay=2e-3, side="motor")
    assert ".entry" in code(monkeypatch, "pendulum_network", "pid", actuator=sprung, sensor=read)


@with_cuda
@pytest.mark.parametrize(
    "law", ["pid", *(pytest.param(law, marks=pytest.mark.slow) for law in LAWS if law != "pid")]
)
def test_every_law_compiles_for_a_device(monkeypatch, law):
    """On one plant: a law reads numbers and returns numbers, whatever the plant."""
    assert ".entry" in code(monkeypatch, "duffing", law)


ALL_IN_A_WORLD = FULL | {"jump": None, "friction": DRY, "fault": smc.Fault(0.5)}


@with_cuda
@pytest.mark.parametrize(
    ("law", "fields"),
    [
        ("pid", ALL_IN_A_WORLD),
        pytest.param("super_twisting", {}, marks=pytest.mark.slow),
        pytest.param("adrc", {"noise": smc.Noise(1e-3, 5e-3)}, marks=pytest.mark.slow),
    ],
)
def test_the_callback_of_worlds_compiles_for_a_device(monkeypatch, law, fields):
    plant = PLANTS_OF_WORLDS["wall"]()
    assert ".entry" in code(monkeypatch, plant, law, worlds=True, **fields)


@with_cuda
def test_a_device_that_cannot_be_used_is_refused(monkeypatch, refused):
    from smc_mujoco.analysis.engine import gpu

    def version():
        raise RuntimeError

    for where, name, fake, words in [
        (gpu.cuda, "is_available", lambda: False, "no card"),
        (gpu.cuda, "is_available", lambda: True, ""),
        (gpu.cuda.cudadrv.driver, "get_version", lambda: (0, 0), "older"),
        (gpu.cuda.runtime, "get_version", version, "pip install"),
    ]:
        monkeypatch.setattr(where, name, fake)
        if words:
            refused(lambda: smc.score([], device="cuda"), words)
