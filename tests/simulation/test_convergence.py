"""The physics step of realistic runs is fine enough: halving it changes no score of a smooth law by
3 %.

Scores are settling_time, ultimate_bound and tv_rate. A score that is nothing but rounding or creep
is compared as if it were at its floor: 1e-4 of the run's scale for the bound, 1e-4 of u_max per
second for tv_rate. Laws and gains are the paper study's, the control period is 1 ms.

With an encoder or a backlash the loop hunts: it ends in a limit cycle of a count or two, or within
the play, and which one is chance - a start 0.2 % off gives another. There the mean over several
starts is compared, and may differ by three of its standard errors more.
"""

import dataclasses
import math

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.backlash import PLAY_STEP
from smc_mujoco.metrics.conventions import scale
from smc_mujoco.simulation.integration import MAX_STEP, REALISTIC_STEP

LAWS = ("observer_free", "boundary_layer")
SCORES = ("settling_time", "ultimate_bound", "tv_rate")
FLOOR = 1e-4  # of the run's scale, and of u_max per second
MOST = 0.03
# s: of most runs, of Van der Pol's, of what hunts or creeps
BRIEF, SLOW, LONG = 3.0, 4.0, 5.0
STARTS = 4  # of what hunts
HUNTING = ("backlash", "encoder")
CREEPING = ("lugre",)

PARTS = {
    "viscous": {"friction": smc.Viscous(0.1)},
    "coulomb": {"friction": smc.Coulomb(0.05)},
    "coulomb, strong": {"friction": smc.Coulomb(0.5)},
    "lugre": {"friction": smc.hardware.LuGre(coulomb=0.05, static=0.08, stribeck=0.01)},
    "lag": {"actuator": smc.Lag(0.005)},
    "rate limit": {"actuator": smc.hardware.RateLimit(200.0)},
    "dc motor": {"actuator": smc.DCMotor()},
    "backlash": {"actuator": smc.Backlash(0.02, rotor_damping=0.02)},
    "encoder": {"sensor": smc.Encoder(counts=4096)},  # on the ideal plant: RK4, 1 ms and 0.5 ms
}
# A start from which the obstacle is hit. Of the bobs the first runs into the others.
APART = {"x0": -0.5, "v0": 12.0}
HITS = {
    "inverted_pendulum": {
        "floor": {"x0": 2.3, "v0": 5.0},
        "stops": {"x0": 0.5, "v0": 8.0},
        "wall": {"x0": 0.5, "v0": 6.0},
        "peg": {"x0": 0.5},
    },
    "duffing": {
        "floor": {},
        "stops": {"v0": 4.0},
        "peg": {},
    },
    "van_der_pol": {
        "floor": {},
        "stops": {"v0": 3.0},
        "peg": {},
    },
    "pendulum_network": {"bobs": APART},
    "inverted_pendulum_network": {"bobs": APART},
}


def cases():
    """(plant, name) -> the fields of a scenario that make it realistic; networks are of two."""
    by_key = {}
    for name in smc.paper.GAINS:
        plant = smc.plant(name) if smc.plant(name).n == 1 else smc.plant(name, n=2)
        for part, fields in PARTS.items():
            by_key[name, part] = {"plant": plant} | fields
        for mechanism in plant.mechanisms:
            by_key[name, mechanism] = {"plant": plant, "mechanism": mechanism}
        for contact, start in HITS[name].items():
            first = {}
            for key, value in start.items():
                first[key] = (value, *[0.0] * (plant.n - 1))
            by_key[name, contact] = {"plant": plant, "contact": contact} | first
    return by_key


def scenarios(key, fields, law, duration):
    """The scenario of a case, or several from starts close by where it hunts."""
    bound = smc.law(law, **smc.paper.GAINS[key[0]][law])
    first = smc.Scenario(**fields, law=bound, duration=duration)
    if key[1] not in HUNTING:
        return [first]
    return [
        dataclasses.replace(first, x0=[x * (1 - 0.002 * i) for x in first.resolved.x0])
        for i in range(STARTS)
    ]


def chosen():
    """(plant, part, law) -> scenarios of networks where they do not hunt, and of all other plants.

    A part is on every second plant, under one law on the first and under the other one on the next.
    """
    by_key = {}
    for i, plant in enumerate(smc.paper.GAINS):
        own = [(key, fields) for key, fields in cases().items() if key[0] == plant]
        for j, (key, fields) in enumerate(own):
            if (i + j) % 2 and (key[1] not in HUNTING or fields["plant"].n == 1):
                duration = BRIEF
                if key[1] in HUNTING + CREEPING:
                    duration = LONG
                elif plant == "van_der_pol":
                    duration = SLOW
                law = LAWS[(i + j) // 2 % len(LAWS)]
                by_key[*key, law] = scenarios(key, fields, law, duration)
    return by_key


def scores(trace):
    """The three scores, none below its floor."""
    assert trace.failure is None
    values = smc.score(trace)
    floors = {
        "ultimate_bound": FLOOR * scale(trace),
        "tv_rate": FLOOR * trace.scenario.resolved.u_max,
    }
    return [max(values[name], floors.get(name, 0.0)) for name in SCORES]


def halved(scenario):
    return dataclasses.replace(scenario, physics_step=scenario.resolved.physics_step / 2)


def study(by_key):
    """(plant, part, law) -> score -> its means with a step and with half of it, and the error of
    their difference.
    """
    all_scenarios = [s for group in by_key.values() for s in (*group, *map(halved, group))]
    traces = iter(smc.run(all_scenarios))
    result = {}
    for key, group in by_key.items():
        coarse, fine = (np.array([scores(next(traces)) for _ in group]) for _ in range(2))
        spread = np.zeros(3)
        if len(group) > 1:
            spread = np.sqrt((coarse.var(axis=0, ddof=1) + fine.var(axis=0, ddof=1)) / len(group))
        values = zip(coarse.mean(axis=0), fine.mean(axis=0), spread, strict=True)
        result[key] = dict(zip(SCORES, values, strict=True))
    return result


def change(coarse, fine):
    """By how much of the finer one's score the other differs."""
    if coarse == fine:  # also where both are inf: neither settles
        return 0.0
    if math.isfinite(fine) and fine:
        return abs(coarse - fine) / fine
    return math.inf


def converged(coarse, fine, spread):
    if spread:
        return change(coarse, fine) < MOST + 3 * spread / fine
    return change(coarse, fine) < MOST


@pytest.mark.slow
def test_halving_the_physics_step_changes_no_score():
    changed = {
        (*key, name): values
        for key, scores in study(chosen()).items()
        for name, values in scores.items()
        if not converged(*values)
    }
    assert not changed


@pytest.mark.quick
def test_realistic_mechanisms_take_the_step_of_the_study_by_default():
    steps = set()
    for key, group in chosen().items():
        if key[1] != "encoder":
            steps.add(group[0].resolved.physics_step)
    # MAX_STEP under RK4, behind a lag or a motor without inductance; PLAY_STEP for stops that do
    # not bounce
    assert steps == {REALISTIC_STEP, MAX_STEP, PLAY_STEP}
