"""What a law of a free body reads in a run, recorded by its C."""

import dataclasses
from pathlib import Path

import numpy as np

import smc_mujoco as smc
from smc_mujoco.control.joint_law import ARRAYS

WIND = (smc.signals.Wind(3.0), smc.signals.Dryden(w20=15.0, speed=3.0))
RECORDER = """#define smc_law recorded_law
#include "law.c"
#undef smc_law
#include <stdio.h>
int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out);
int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)
{
    FILE *file = fopen("PATH", "ab");
    fwrite(y, sizeof *y, 1, file);
    fclose(file);
    return recorded_law(y, gains, memory, out);
}
"""
ARRAY_SHAPES = {name: (6, 6) if name == "M" else (6,) for name in ARRAYS}
# as in smc_law.h
MEASUREMENT = np.dtype(
    [
        ("head", "f8", (3,)),
        *((name, "f8", shape) for name, shape in ARRAY_SHAPES.items()),
        ("functions", "i8", (3,)),
    ]
)


def scenarios(law) -> list[smc.Scenario]:
    """Of the library's quadrotor, along a path in turbulence, and of a drone of one's own, which
    starts turned.
    """
    drone = smc.plant_from("examples/quadrotor.xml", channels=["body"], keyframe="hover")
    common = {
        "law": law,
        "noise": smc.Noise(1e-3, 1e-2),
        "duration": 0.4,
    }
    return [
        smc.Scenario(
            plant="quadrotor",
            disturbance=WIND,
            reference=smc.Sine(0.2, 3.0),
            **common,
        ),
        smc.Scenario(
            plant=drone,
            x0=(0.3, 0.2, 1.0, 0.1, 0.2, 2.5),
            v0=(0.0, 0.0, 0.0, 3.0, 0.0, 2.0),
            **common,
        ),
    ]


def recorded(scenario: smc.Scenario, folder: Path) -> tuple[smc.Trace, np.ndarray]:
    """A run's trace, and what its law read at each sample, whose C is then law.c in a folder."""
    (folder / "law.c").write_text(smc.exchange.law_to_c(scenario))
    (folder / "recorder.c").write_text(RECORDER.replace("PATH", str(folder / "read")))
    law = smc.exchange.law_from_c(folder / "recorder.c", timeout=60.0)
    (folder / "read").unlink(missing_ok=True)
    trace, again = smc.run([scenario, dataclasses.replace(scenario, law=law)])
    for field in ("x", "v", "u", "s", "applied"):  # so it read what the law of the scenario reads
        np.testing.assert_array_equal(getattr(again, field), getattr(trace, field))
    return trace, np.fromfile(folder / "read", MEASUREMENT)
