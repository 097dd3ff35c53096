"""The study of the paper: its plants' gains and the conditions under which its laws are compared.

The paper (J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition") states d(t) = 0.2 sin(5t), five
pendulums and Gaussian noise on x and v; it states no gain and no other parameter. Those here were chosen for this
study: every law is bounded by the same |u| <= 6, and its gains are those of a set in `gains`. The realistic conditions
are ours, levels that a machine of this size has. The plants' parameters stand in their files.

    scenario("duffing", "classical", "noise", seed=3)      # one Scenario
    comparison("duffing", "noise")                         # the four laws: name -> Scenario
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from smc_mujoco import gains as sets
from smc_mujoco.actuators import DCMotor, Lag
from smc_mujoco.backlash import Backlash
from smc_mujoco.conditions import Jump, Noise
from smc_mujoco.errors import ScenarioError, find, shown, unknown
from smc_mujoco.estimators import estimator
from smc_mujoco.friction import Coulomb, LuGre
from smc_mujoco.frozen import frozen
from smc_mujoco.given import U_MAX
from smc_mujoco.scenario import Scenario
from smc_mujoco.sensors import Encoder
from smc_mujoco.signals import Constant, OrnsteinUhlenbeck, Pulse, Sine, Step

# The four laws that the paper compares; its higher-order one is the last.
LAWS = ("observer_free", "classical", "adaptive", "super_twisting")
GAINS = sets.STUDY
PLANTS = tuple(GAINS)
FIELDS = [field.name for field in dataclasses.fields(Scenario)]
NOTHING: Mapping[str, Any] = frozen({})
DURATION, CONTROL_PERIOD = 10.0, 1e-3  # s

# Plant -> parameter -> factor, at half time, with the sine disturbance: a mild and a hard one.
JUMP_MILD: dict[str, dict[str, float]] = {
    "inverted_pendulum": {"mass": 2.0},
    "pendulum_network": {"mass": 2.0},
    "inverted_pendulum_network": {"mass": 2.0},
    "van_der_pol": {"mu": 3.0},
    "duffing": {"alpha": 3.0},
}
JUMP_HARD: dict[str, dict[str, float]] = {
    "inverted_pendulum": {"mass": 25.912},
    "van_der_pol": {"mu": 9.0},
    "duffing": {"alpha": 27.684},
    "pendulum_network": {"mass": 11.062},
    "inverted_pendulum_network": {"mass": 22.681},
}

SINE = Sine(amplitude=0.2, omega=5.0)
SENSOR_NOISE = Noise(position=0.01, velocity=0.05)
DIFFERENCED = estimator("filtered_difference", tau=5e-3)


def _jump(factors: dict[str, dict[str, float]]) -> Callable[[str, float], dict]:
    return lambda plant, half: {"disturbance": SINE, "jump": Jump(time=half, factors=factors[plant])}


# Condition -> the Scenario fields that it sets, or how they follow from the plant's name and half the duration.
Conditions = Mapping[str, dict[str, Any] | Callable[[str, float], dict[str, Any]]]

# What real machines do. 0.1 N m or N of friction is u_max / 60, the gap a worn gear's, the lag a hydraulic valve's, the
# counts, per revolution or metre, an inexpensive encoder's; the pulse, as strong as u_max, throws what can be thrown.
CONTACTS = {plant: "bobs" if plant.endswith("network") else "stops" for plant in PLANTS}
REALISTIC: Conditions = {
    "coulomb": {"friction": Coulomb(0.1)},
    "lugre": {"friction": LuGre(coulomb=0.05, static=0.1, stribeck=0.05)},
    "lag_20ms": {"actuator": Lag(0.02)},
    "dc_motor": {"actuator": DCMotor()},
    "backlash": {"actuator": Backlash(0.01)},
    "encoder": {"sensor": Encoder(counts=4096)},
    "contact": lambda plant, half: {"contact": CONTACTS[plant], "disturbance": Pulse(6.0, time=half, width=0.2)},
}

CONDITIONS: Conditions = {
    "nominal": {},
    "noise": {"noise": SENSOR_NOISE},
    "sine": {"disturbance": SINE},
    "constant": {"disturbance": Constant(0.2)},
    "step": lambda plant, half: {"disturbance": Step(0.2, time=half)},
    "pulse": lambda plant, half: {"disturbance": Pulse(2.0, time=half, width=0.1)},
    "process_noise": {"disturbance": OrnsteinUhlenbeck(sigma=0.2, tau=0.1)},
    **{f"delay_{ms}ms": {"input_delay": ms * 1e-3} for ms in (1, 5, 10, 20, 50)},
    "light": {"mismatch": {"mass": 0.7}},
    "heavy": {"mismatch": {"mass": 1.3}},
    "jump_mild": _jump(JUMP_MILD),
    "jump_hard": _jump(JUMP_HARD),
    **{f"period_{ms}ms": {"control_period": ms * 1e-3} for ms in (10, 20, 50)},
    "differenced_5ms": {"velocity": DIFFERENCED},
    "differenced_5ms_noise": {"velocity": DIFFERENCED, "noise": Noise(position=0.01)},
    **REALISTIC,
}


def fields(condition: str, plant: str, duration: float = DURATION) -> dict[str, Any]:
    """The Scenario fields that a condition sets, in runs of that duration; what happens once does so at half time.

    Raises:
      ScenarioError: a condition or plant that the study does not have.
    """
    found = find("condition of the paper's study", condition, CONDITIONS)
    if not callable(found):
        return found
    if plant not in GAINS:
        cure = f"choose another condition, or a plant of the study: {', '.join(PLANTS)}"
        raise ScenarioError(f"condition {condition!r} has no numbers for plant {plant!r}: {cure}")
    return found(plant, duration / 2)


def scenario(
    plant: str,
    law_name: str,
    condition: str = "nominal",
    seed: int = 0,
    duration: float = DURATION,
    changes: Mapping[str, Any] = NOTHING,
    gains: str = "study",
) -> Scenario:
    """The scenario of one plant under one law in one condition.

    Args:
      changes: Scenario field -> value, over what the study and the condition have, such as {"friction": Coulomb(0.1)}.
      gains: a set of `gains`: "study", "tuned", "tracking", or "default".

    Raises:
      ScenarioError: a name that the study does not have, or that is no field of a Scenario.
    """
    if not isinstance(changes, Mapping):
        raise ScenarioError(f"changes is {shown(changes)}: give Scenario fields with their values")
    for name in changes:
        if name not in FIELDS:
            raise unknown("field of a Scenario", name, FIELDS)
    sets.paper_plant(plant)
    found = sets.law(plant, law_name, "default" if law_name == "none" else gains)
    common = {"duration": duration, "control_period": CONTROL_PERIOD, "u_max": U_MAX, "seed": seed}
    conditioned = fields(condition, plant, duration)
    return Scenario(**({"plant": plant, "law": found} | common | conditioned | dict(changes)))


def comparison(
    plant: str,
    condition: str = "nominal",
    laws: Sequence[str] = LAWS,
    seed: int = 0,
    duration: float = DURATION,
    changes: Mapping[str, Any] = NOTHING,
    gains: str = "study",
) -> dict[str, Scenario]:
    """Law name -> scenario: one plant in one condition under several laws; arguments as of `scenario`."""
    return {name: scenario(plant, name, condition, seed, duration, changes, gains) for name in laws}
