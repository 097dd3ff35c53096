"""EMPS, unfitted: the program of the public record, and the tracking error that was recorded."""

import numpy as np
import pytest

import smc_mujoco as smc
from benchmarks import programs
from smc_mujoco.evidence.rigs.machines.emps import PERIOD
from smc_mujoco.simulation.time_series import TimeSeries

RECORDED = 0.5814e-3, 0.8522e-3  # m, rms and largest, of the public record
RIG = smc.rig("emps")
PROGRAM = programs.program()


@pytest.mark.quick
def test_the_program_is_periodic_and_as_fast_as_recorded():
    r = np.array(PROGRAM.values)
    v = np.diff(r) / PERIOD
    assert len(r) == programs.SAMPLES
    np.testing.assert_array_equal(r[: -programs.LAP], r[programs.LAP :])
    assert (v.max(), v.min()) == pytest.approx((0.1247, -0.1247), abs=5e-5)
    assert (r[0], v[0]) == pytest.approx(programs.START, rel=0.04)


def test_the_tracking_error_is_the_recorded_one_to_a_hundredth():
    assert programs.tracking(RIG) == pytest.approx(RECORDED, rel=0.01)


def test_a_reference_a_tick_late_or_early_errs_by_fifteen_hundredths():
    """So which instant a sample has decides more than any quantity of the machine."""
    r = list(PROGRAM.values)
    rms, _ = programs.tracking(RIG)
    late, _ = programs.tracking(RIG, TimeSeries(PROGRAM.times, [r[0], *r[:-1]]))
    early, _ = programs.tracking(RIG, TimeSeries(PROGRAM.times, [*r[1:], r[-1]]))
    assert (late / rms, early / rms) == pytest.approx((1.15, 0.85), abs=0.01)


def test_the_error_at_constant_speed_is_that_of_the_formula():
    """v / kp + F / (kv kp force_per_volt), with F the friction at that speed, late on the longest
    plateau.
    """
    q = RIG.values
    gains = RIG.scenario().law.gains
    trace = smc.run(
        RIG.scenario(
            reference=PROGRAM,
            duration=2.4,
            x0=programs.START[0],
            v0=programs.START[1],
        )
    )
    k = 2000
    v = trace.v[k, 0]
    force = q["viscous"] * v + q["coulomb"] + q["offset"]
    expected = v / gains["kp"] + force / (q["force_per_volt"] * gains["kv"] * gains["kp"])
    assert PROGRAM.values[k] - trace.x[k, 0] == pytest.approx(expected, rel=0.01)
