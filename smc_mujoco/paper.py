"""The study of the paper: its plants' gains and the conditions under which its laws are compared.

The paper (J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition") states d(t) = 0.2 sin(5t), five
pendulums and Gaussian noise on x and v; it states no gain and no other parameter. Those here were chosen for this
study: every law is bounded by the same |u| <= 6, and the gains are a first tuning of all laws to that bound, kept
whatever the results. The plants' parameters stand in their files.

    scenario("duffing", "classical", "noise", seed=3)      # one Scenario
    comparison("duffing", "noise")                         # the four laws: name -> Scenario
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from smc_mujoco.conditions import Jump, Noise
from smc_mujoco.errors import ScenarioError, find, shown, unknown
from smc_mujoco.estimators import estimator
from smc_mujoco.frozen import frozen
from smc_mujoco.law import law
from smc_mujoco.scenario import Scenario
from smc_mujoco.signals import Constant, OrnsteinUhlenbeck, Pulse, Sine, Step

# The four laws that the paper compares; its higher-order one is the last.
LAWS = ("observer_free", "classical", "adaptive", "super_twisting")
FIELDS = [field.name for field in dataclasses.fields(Scenario)]
NOTHING: Mapping[str, Any] = frozen({})
DURATION, CONTROL_PERIOD, U_MAX = 10.0, 1e-3, 6.0  # s, s, N or N m

# Plant -> law -> gains.
GAINS: dict[str, dict[str, dict[str, float]]] = {
    "inverted_pendulum": {
        "observer_free": {"lam": 4.364, "k1": 9.708},
        "classical": {"k": 1.945, "c": 12.0},
        "boundary_layer": {"k": 6.0, "c": 9.06, "phi": 2.096},
        "adaptive": {"gamma": 104.7, "c": 12.0, "k0": 0.0},
        "adaptive_leak": {"gamma": 20.31, "c": 12.0, "leak": 8.865, "deadzone": 0.2114, "k0": 0.0},
        "super_twisting": {"k1": 2.489, "k2": 16.92, "c": 10.04},
    },
    "van_der_pol": {
        "observer_free": {"lam": 6.0, "k1": 1.976},
        "classical": {"k": 6.0, "c": 2.849},
        "boundary_layer": {"k": 5.763, "c": 2.768, "phi": 0.01578},
        "adaptive": {"gamma": 66.11, "c": 2.853, "k0": 0.0},
        "adaptive_leak": {"gamma": 7.738, "c": 2.821, "leak": 0.9379, "deadzone": 0.03367, "k0": 0.0},
        "super_twisting": {"k1": 4.567, "k2": 45.47, "c": 2.16},
    },
    "duffing": {
        "observer_free": {"lam": 6.0, "k1": 3.076},
        "classical": {"k": 3.91, "c": 3.576},
        "boundary_layer": {"k": 6.0, "c": 3.975, "phi": 0.5429},
        "adaptive": {"gamma": 600.0, "c": 4.371, "k0": 0.0},
        "adaptive_leak": {"gamma": 13.87, "c": 4.256, "leak": 2.979, "deadzone": 0.009447, "k0": 0.0},
        "super_twisting": {"k1": 8.073, "k2": 0.3443, "c": 4.061},
    },
    "pendulum_network": {
        "observer_free": {"lam": 2.922, "k1": 6.19},
        "classical": {"k": 0.9747, "c": 5.944},
        "boundary_layer": {"k": 6.0, "c": 6.705, "phi": 2.577},
        "adaptive": {"gamma": 1.294, "c": 6.718, "k0": 0.0},
        "adaptive_leak": {"gamma": 24.32, "c": 9.468, "leak": 9.259, "deadzone": 0.3184, "k0": 0.0},
        "super_twisting": {"k1": 1.87, "k2": 1.145, "c": 6.256},
    },
    "inverted_pendulum_network": {
        "observer_free": {"lam": 3.961, "k1": 9.362},
        "classical": {"k": 1.73, "c": 11.11},
        "boundary_layer": {"k": 6.0, "c": 8.705, "phi": 2.328},
        "adaptive": {"gamma": 2.189, "c": 9.408, "k0": 0.0},
        "adaptive_leak": {"gamma": 28.47, "c": 11.36, "leak": 11.46, "deadzone": 0.153, "k0": 0.0},
        "super_twisting": {"k1": 1.95, "k2": 1.057, "c": 9.086},
    },
}

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


def _jump(factors: dict[str, dict[str, float]]) -> Callable[[str], dict]:
    return lambda plant: {"disturbance": SINE, "jump": Jump(time=DURATION / 2, factors=factors[plant])}


# Condition -> the Scenario fields that it sets, or a function of the plant's name that gives them.
CONDITIONS: dict[str, dict | Callable[[str], dict]] = {
    "nominal": {},
    "noise": {"noise": SENSOR_NOISE},
    "sine": {"disturbance": SINE},
    "constant": {"disturbance": Constant(0.2)},
    "step": {"disturbance": Step(0.2, time=5.0)},
    "pulse": {"disturbance": Pulse(2.0, time=5.0, width=0.1)},
    "process_noise": {"disturbance": OrnsteinUhlenbeck(sigma=0.2, tau=0.1)},
    **{f"delay_{ms}ms": {"input_delay": ms * 1e-3} for ms in (1, 5, 10, 20, 50)},
    "light": {"mismatch": {"mass": 0.7}},
    "heavy": {"mismatch": {"mass": 1.3}},
    "jump_mild": _jump(JUMP_MILD),
    "jump_hard": _jump(JUMP_HARD),
    **{f"period_{ms}ms": {"control_period": ms * 1e-3} for ms in (10, 20, 50)},
    "differenced_5ms": {"velocity": DIFFERENCED},
    "differenced_5ms_noise": {"velocity": DIFFERENCED, "noise": Noise(position=0.01)},
}


def scenario(
    plant: str,
    law_name: str,
    condition: str = "nominal",
    seed: int = 0,
    duration: float = DURATION,
    changes: Mapping[str, Any] = NOTHING,
) -> Scenario:
    """The scenario of one plant under one law in one condition.

    Args:
      changes: Scenario field -> value, over what the study and the condition have, such as {"friction": Coulomb(0.1)}.

    Raises:
      ScenarioError: a name that the study does not have, or that is no field of a Scenario.
    """
    if not isinstance(changes, Mapping):
        raise ScenarioError(f"changes is {shown(changes)}: give Scenario fields with their values")
    for name in changes:
        if name not in FIELDS:
            raise unknown("field of a Scenario", name, FIELDS)
    gains = find("law of the paper's study", law_name, find("plant of the paper's study", plant, GAINS) | {"none": {}})
    fields = find("condition of the paper's study", condition, CONDITIONS)
    common = {"duration": duration, "control_period": CONTROL_PERIOD, "u_max": U_MAX, "seed": seed}
    conditioned = fields(plant) if callable(fields) else fields
    return Scenario(**({"plant": plant, "law": law(law_name, **gains)} | common | conditioned | dict(changes)))


def comparison(
    plant: str,
    condition: str = "nominal",
    laws: Sequence[str] = LAWS,
    seed: int = 0,
    duration: float = DURATION,
    changes: Mapping[str, Any] = NOTHING,
) -> dict[str, Scenario]:
    """Law name -> scenario: one plant in one condition under several laws; arguments as of `scenario`."""
    return {name: scenario(plant, name, condition, seed, duration, changes) for name in laws}
