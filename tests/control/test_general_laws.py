"""Which laws a board of all laws ranks."""

import pytest

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.gain_sets import ALIASES, general_laws
from smc_mujoco.control.law import catalogue

pytestmark = pytest.mark.quick


def test_every_general_law_is_ranked_and_no_law_beside_itself():
    found = general_laws(smc.paper.PLANTS, "default")
    assert len(found) >= 35
    assert not set(found) & {"none", "hierarchical", "swing_up", *ALIASES}
    assert {"adaptive_leak", "observer_free", "pid"} <= set(found)
    assert all(name in found for name, law in catalogue().items() if not law.plants and name not in ("none", *ALIASES))


def test_a_law_without_gains_in_the_set_on_one_of_the_plants_is_left_out():
    assert set(general_laws(["duffing"], "study")) <= set(smc.paper.GAINS["duffing"]) | {"conditioned_super_twisting"}
    with pytest.raises(ScenarioError, match="set of gains"):
        general_laws(["duffing"], "best")


def test_a_set_without_gains_for_any_law_on_the_plants_is_refused():
    with pytest.raises(ScenarioError, match=r"'tracking', and no general law has such gains on pendubot: give"):
        general_laws(["pendubot"], "tracking")
