"""The report's section on chattering: predicted, and run."""

import dataclasses
import math

import pytest

from smc_mujoco.evidence.report import oscillation
from smc_mujoco.evidence.report.plan import QUICK, Bars, Work

PLAN = dataclasses.replace(QUICK, plants=("duffing",), laws=("super_twisting", "observer_free"))


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    work = Work(plan=PLAN, folder=folder, threads=1, bars=Bars(False))
    first = oscillation.oscillations(work)
    assert [file.suffix for file in folder.iterdir()] == [".json"]
    with pytest.MonkeyPatch.context() as patch:
        patch.delattr(oscillation, "run")  # the second time they are read from the file
        second = oscillation.oscillations(work)
    assert repr(second) == repr(first)
    return second


@pytest.mark.slow
def test_a_switching_law_oscillates_as_predicted_and_a_smooth_one_is_calm(found):
    switching, smooth = found
    assert (switching.law, smooth.law) == PLAN.laws
    assert abs(switching.error) < 100.0 * switching.uncertainty  # %
    assert switching.measured_frequency == pytest.approx(switching.frequency, rel=0.05)
    assert math.isnan(smooth.amplitude)
    assert math.isnan(smooth.error)


def test_the_sentence_counts_pairs_and_takes_the_median_error(found):
    switching, smooth = found
    calm = dataclasses.replace(smooth, measured_amplitude=math.nan)
    worse = []
    for q in (1.3, 0.5):
        worse.append(dataclasses.replace(switching, amplitude=q * switching.measured_amplitude))
    better = dataclasses.replace(switching, amplitude=1.01 * switching.measured_amplitude)
    said = oscillation.sentence((*worse, better, calm))
    assert said.startswith(
        "Of 4 pairs of plant and law 3 are predicted to oscillate and do; 1 do neither."
    )
    unseen = dataclasses.replace(switching, measured_amplitude=math.nan)
    assert (
        "2 are predicted to oscillate and do; 0 do neither; for 1 prediction and run disagree."
        in (oscillation.sentence((*worse, unseen)))
    )
    assert said.endswith("is 30 %, the largest 50 %.")
    better = dataclasses.replace(switching, amplitude=1.1 * switching.measured_amplitude)
    assert oscillation.sentence((worse[0], better)).endswith(
        "is 20 %, the largest 30 %."
    )  # midway between 10 % and 30 %
