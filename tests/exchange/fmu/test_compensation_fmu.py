"""A Feedforward in FMUs: u has the bits of a run with it, and what was added is an output."""

import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy", reason="FMPy, pip install 'smc-mujoco[fmu]', is not installed")

from exchange.helpers.compiler import needs_compiler  # noqa: E402
from exchange.helpers.fmu import Importer  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402
from helpers import arms  # noqa: E402

import smc_mujoco as smc  # noqa: E402
from smc_mujoco.hardware import Stribeck  # noqa: E402

pytestmark = needs_compiler

REFERENCE = smc.Sine(0.2, 3.0)
RUBS = smc.Coulomb(0.2), smc.Viscous(0.1), Stribeck(0.1, 0.3, 0.2)
CHANNEL = {"plant": "duffing", "law": smc.law("super_twisting", k1=3.0)}
JOINTS = {"plant": arms.arm, "law": smc.law("observer_free_joint"), "u_max": 50.0}
WAYS = {
    "one channel": (CHANNEL | {"u_max": 1.5, "velocity": "levant"}, RUBS, "speed"),
    "joints": (JOINTS, {"turn": RUBS, "reach": smc.Coulomb(1.0)}, "reference"),
}


@pytest.mark.quick
@pytest.mark.parametrize("way", WAYS)
def test_u_and_compensation_have_the_bits_of_a_run(tmp_path, way):
    fields, rubs, on = WAYS[way]
    if callable(fields["plant"]):
        fields = fields | {"plant": fields["plant"]()}
    scenario = smc.Scenario(
        feedforward=smc.Feedforward(rubs, on=on), reference=REFERENCE, duration=0.1, **fields
    )
    path = smc.exchange.law_to_fmu(scenario, tmp_path / "law.fmu")
    assert validate_fmu(str(path)) == []
    described = fmpy.read_model_description(str(path)).modelVariables
    kinds = {variable.name.partition("[")[0]: variable.causality for variable in described}
    assert kinds["compensation"] == kinds["u"] == "output"
    trace = smc.run(scenario)
    fmu = Importer(path, tmp_path / "law")
    places = [f"[{i + 1}]" for i in range(trace.u.shape[1])] if scenario.law.joint else [""]
    outputs = []
    for k, t in enumerate(trace.t):
        r, dr, ddr = smc.Sine.value(t, REFERENCE)
        for i, place in enumerate(places):
            inputs = {"x": trace.x[k, i], "v": trace.v[k, i], "r": r, "dr": dr, "ddr": ddr}
            fmu.set(
                **{
                    name + place: number
                    for name, number in inputs.items()
                    if name + place in fmu.at
                }
            )
        fmu.fmu.doStep(t, 1e-3)
        outputs.append(
            fmu.get(*(name + place for name in ("u", "compensation") for place in places))
        )
    assert fmu.said == []
    np.testing.assert_array_equal(outputs, np.hstack([trace.u, trace.compensation]))
    assert len(np.unique(trace.compensation)) > 50
