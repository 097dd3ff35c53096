"""Every law, surface and estimator has the gains and computes the numbers that are recorded.

Theorems hold for every gain, so they do not see a default, a unit or an order that has changed,
which would change published numbers. Here all of it is seen at once. What is added to a catalogue
is tested once it is recorded.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.words import recorded

from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control import estimator, surface
from smc_mujoco.control import law as laws
from smc_mujoco.control.component import gain_text
from smc_mujoco.control.estimator import Reading
from smc_mujoco.control.joint_law import JointMeasurement
from smc_mujoco.control.law import FREE_BODY, Measurement
from smc_mujoco.simulation import python_functions

pytestmark = pytest.mark.quick

KINDS = {
    "law": laws.law_catalogue,
    "joint law": laws.joint_law_catalogue,
    "surface": surface.surface_catalogue,
    "estimator": estimator.estimator_catalogue,
}
TEMPLATES = {f"{kind} {name}": law for kind, room in KINDS.items() for name, law in room().items()}
COUNT = 60
DT = 0.05
JOINTS = 3


def moved(template):
    """Gains beside their defaults: 7 % more, 0.3 for 0 and 2 for infinity."""
    changed = {0.0: 0.3, math.inf: 2.0}
    return template.bind(
        {gain: changed.get(value, 1.07 * value) for gain, value in template.defaults.items()}
    )


def seen(shape=()):
    """Errors and speeds of both signs and all sizes from 1 to 0.001, exact zeros among them, and
    other readings.
    """
    random = np.random.default_rng(7)
    sizes = 10.0 ** np.linspace(0.0, -3.0, COUNT).reshape(-1, *(1 for _ in shape))
    e, de, further = (random.normal(size=(COUNT, *shape)) for _ in range(3))
    e = e * sizes
    de = de * sizes
    e[20] = de[30] = e[40] = de[40] = 0.0
    return zip(e, de, further, strict=True)


def measurements(model, has_surface):
    for k, (e, de, numbers) in enumerate(seen()):
        yield Measurement(
            t=0.5 + DT * k,
            dt=DT,
            x=e + 0.3,
            v=de - 0.2,
            e=e,
            de=de,
            r=0.3,
            dr=-0.2,
            ddr=0.7,
            f=numbers,
            g=1.7,
            a=2.0 * numbers,
            limit=3.0,
            model=model,
            has_surface=has_surface,
            s=e - 0.5 * de,
            v_eq=0.4 * numbers,
            q=e + 0.1 * de,
            dq=de - 0.1 * e,
            fq=-numbers,
            gq=0.6,
        )


def joints(component):
    """The number of channels of a law of many joints: those of a free body are six."""
    if FREE_BODY in component.plants:
        return 2 * JOINTS
    return JOINTS


def joint_measurements(model, n):
    turned = np.array([[0.0, 0.3, -0.2], [-0.3, 0.0, 0.5], [0.2, -0.5, 0.0]])
    dynamics = SimpleNamespace(
        coriolis=lambda w: turned @ w, jacobian=lambda: np.eye(JOINTS) + turned
    )
    M = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, 0.2], [0.1, 0.2, 1.1]])
    ones = np.ones(n)
    M = np.kron(np.eye(n // JOINTS), M)
    for k, (e, de, numbers) in enumerate(seen((n,))):
        yield JointMeasurement(
            t=DT * k,
            dt=DT,
            model=model,
            dynamics=dynamics,
            x=e + 0.3,
            v=de - 0.2,
            e=e,
            de=de,
            r=0.3 * ones,
            dr=-0.2 * ones,
            ddr=0.7 * numbers,
            a=numbers,
            limit=3.0 * ones,
            M=M,
            h=0.5 * numbers - de,
            g=0.5 * numbers,
        )


def readings():
    return (
        Reading(
            dt=DT,
            x=math.sin(0.2 * k) + 0.1 * e,
            v=de,
        )
        for k, (e, de, _) in enumerate(seen())
    )


def ways(template):
    """Name of a way through a component's inputs -> the inputs."""
    if template.kind == "estimator":
        return {"computes": readings()}
    if template.joint:
        n = joints(template)
        return {
            "alone": joint_measurements(0.0, n),
            "with the model": joint_measurements(1.0, n),
        }
    by_way = {
        "alone": measurements(0.0, 0.0),
        "with the model": measurements(1.0, 0.0),
    }
    if template.kind == "law":
        return by_way | {"on a surface": measurements(1.0, 1.0)}
    return by_way


def computed(component, inputs):
    """Weighted sums of each result over all samples, and of the memory at the end."""
    function = rebuild(component.function, lambda plain: plain)
    joint = component.joint
    memory = np.zeros((joints(component), component.memory) if joint else component.memory)
    gains = python_functions.gains_of(component, joints(component))
    results = np.array([function(y, gains, memory) for y in inputs]).reshape(COUNT, -1)
    weights = np.random.default_rng(8).uniform(0.5, 1.5, results.shape)
    last = memory.ravel()
    sums = [*(weights * results).sum(axis=0), last @ np.linspace(0.5, 1.5, last.size)]
    return ", ".join(f"{value:.7g}" for value in sums)


def text(template):
    """What of a template changes published numbers: orders, sizes, gains, and what it computes, in
    one line.
    """
    component = moved(template)
    g = SimpleNamespace(**component.gains)
    said = [flag for flag in ("continuous", "joint", "requires_model") if getattr(template, flag)]
    if template.finite_time:
        said += [f"{template.finite_time} = 0 after a finite time"]
    said += [
        f"order of {what} {template.order(what, component.gains):.7g}" for what in template.accuracy
    ]
    said += [f"admits {what} below {bound(g):.7g}" for what, bound in template.admits.items()]
    said += [
        f"degree {template.relative_degree}",
        f"memory {template.memory}",
        f"for {template.plants or 'all'}",
    ]
    parts = [", ".join(said)]
    for name, gain in template.gains.items():
        unit = gain.unit_at(component.gains)
        marks = []
        for flag in ("positive", "nonnegative", "held", "shared"):
            if getattr(gain, flag):
                marks.append(flag)
        marks += [f"over {gain.over}"] if gain.over else []
        if unit is None:
            size = "no unit"
        else:
            size = "F^{:.4g} X^{:.4g} T^{:.4g}".format(*unit)
        parts.append(", ".join([f"{name} = {gain_text(gain.default)}", size, *marks]))
    if template.linear_part:
        numbers = [
            *template.linear_part.linear(g),
            *template.linear_part.force(g, np.array([-0.2, 0.05, 3.0])),
        ]
        parts.append(f"at rest {', '.join(f'{number:.7g}' for number in numbers)}")
    sums: dict[str, list[str]] = {}  # of the ways that compute the same
    for way, inputs in ways(template).items():
        sums.setdefault(computed(component, inputs), []).append(way)
    return "; ".join(
        [*parts, *(f"{' and '.join(names)}: {numbers}" for numbers, names in sums.items())]
    )


def test_a_component_is_and_computes_what_is_recorded(snapshot):
    assert {name: text(TEMPLATES[name]) for name in recorded(__file__, TEMPLATES)} == snapshot
