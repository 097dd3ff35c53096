"""The study of the paper: its plants' gains and the conditions under which its laws are compared.

The paper (J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition") states d(t)
= 0.2 sin(5t), five pendulums and Gaussian noise on x and v; it states no gain and no other
parameter. Those here were chosen for this study: every law is bounded by the same |u| <= 6, and its
gains are those of a set in `gains`. Its conditions are named in `simulation.conditions`. The
plants' parameters are in their files.

    scenario("duffing", "classical", "noise", seed=3)      # one Scenario
    comparison("duffing", "noise")                         # the four laws: name -> Scenario
"""

import dataclasses
from collections.abc import Sequence

from smc_mujoco.common.aliases import Data
from smc_mujoco.common.errors import unknown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.control import gain_sets as sets
from smc_mujoco.simulation.conditions import (  # noqa: F401
    CONTROL_PERIOD,
    DURATION,
    NAMED,
    PLANTS,
    Condition,
)
from smc_mujoco.simulation.force_bounds import U_MAX  # noqa: F401
from smc_mujoco.simulation.grid import case
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.suite_conditions import SINE  # noqa: F401

# The four laws that the paper compares; its higher-order one is the last.
LAWS = ("observer_free", "classical", "adaptive", "super_twisting")
GAINS = sets.STUDY
CONDITIONS = NAMED  # of the whole suite


def scenario(
    plant: str,
    law_name: str,
    condition: str | Condition = "nominal",
    seed: int = 0,
    duration: float = DURATION,
    changes: Data = frozen({}),
    gains: str = "study",
) -> Scenario:
    """Return the scenario of one plant under one law in one condition.

    Args:
      changes: Scenario field -> value, in place of the study's or the condition's: {"friction":
        Coulomb(0.1)}.
      gains: a set of `gains`: "study", "tuned", "tracking", or "default".

    Raises:
      ScenarioError: a name that the study does not have, or that is no field of a Scenario.
    """
    for name in changes:
        if name not in Scenario.fields():
            raise unknown("field of a Scenario", name, Scenario.fields())
    of_study = case(sets.paper_plant(plant), law_name, condition, duration, gains, changes=changes)
    return dataclasses.replace(of_study, seed=changes.get("seed", seed)).named(
        None if changes else of_study.condition
    )


def comparison(
    plant: str,
    condition: str | Condition = "nominal",
    laws: Sequence[str] = LAWS,
    duration: float = DURATION,
    changes: Data = frozen({}),
    gains: str = "study",
) -> dict[str, Scenario]:
    """Return law name -> scenario, for one plant in one condition; arguments as of `scenario`."""
    scenarios = {}
    for name in laws:
        scenarios[name] = scenario(
            plant, name, condition, duration=duration, changes=changes, gains=gains
        )
    return scenarios
