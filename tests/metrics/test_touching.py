"""Whether a run touched a stop or an obstacle, as the column of a study says."""

import pytest

import smc_mujoco as smc
from smc_mujoco.studies.batches import result_columns


@pytest.mark.quick
@pytest.mark.parametrize(
    ("contact", "touched"),
    [
        # duffing's own start, 1.5, is beyond these stops
        (smc.Stops({"slide": (-0.5, 0.5)}), True),
        (smc.Stops({"slide": (-50.0, 50.0)}), False),
        ((), None),
    ],
)
def test_a_run_says_whether_it_touched(contact, touched):
    case = smc.Scenario(plant="duffing", law="none", contact=contact, x0=0.4, v0=1.0, duration=0.5)
    assert result_columns(smc.run([case])[0])["touched"] is touched
