"""A law of one channel as the outer law of computed torque, for mechanisms of many joints.

    smc.law("adrc", wc=12.0).on_computed_torque()

u = M(x) (v + r'') + h(x, v) with the nominal M and h, and v_i the outer law's command for joint i.
With the perfect model each joint obeys e'' = v + d_a, d_a = M^-1 d, whatever the others do. So the
outer law meets the double integrator of its theorem, with b = 1. What it estimates or integrates is
friction, payload and the model's error, as an acceleration. Its bound is the acceleration that its
motor can still give while the others rest, (u_max - |h_i|) / M_ii. So its anti-windup is right for
one joint that saturates, and approximate for several.
"""

# pyright: reportCallIssue=false
# (the fields of a law's gains are known when it is made)
import dataclasses
from collections.abc import Callable

from numba import njit

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.jit import named
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.joint_law import torque
from smc_mujoco.control.law import Measurement, law_function

_templates: dict[Callable, Template] = {}  # function of an outer law -> its law of many joints


def on_computed_torque(law: Component) -> Component:
    """Return the law of many joints with a law of one channel, and its gains, as its outer law."""
    if law.joint or law.each or law.template is None or law.plants:
        raise ScenarioError(
            f"{law.name} cannot be the outer law of computed torque: give one law of one channel, for all plants"
        )
    if (
        law.template.function not in _templates
    ):  # one function for each law, so that equal laws are equal
        _templates[law.template.function] = _template(law.template)
    template = _templates[law.template.function]
    made = template.bind(
        {name: value for name, value in law.gains.items() if name in template.gains}
    )
    return made.sourced(law.source.kind, law.source.search)


def _template(outer: Template) -> Template:
    """Return the template of a law of many joints with this one as its outer law."""
    inner = njit(outer.function)
    names = tuple(outer.gains)
    # the plant is e'' = v
    own = {}
    for name, gain in outer.gains.items():
        if not gain.plant:
            own[name] = gain
    values = ", ".join(
        f"gains.{name}[i]" if name in own else f"{gain.default!r}"
        for name, gain in outer.gains.items()
    )
    space = {"Gains": named(names), "inf": float("inf")}
    exec(f"def of_joint(gains, i): return Gains({values})", space)
    of_joint = njit(space["of_joint"])

    def law(y, gains, memory):
        v = 0.0 * y.e
        s = 0.0 * y.e
        for i in range(len(v)):
            bound = max(y.limit[i] - abs(y.h[i]), 0.0) / y.M[i, i]
            seen = Measurement(
                y.t,
                y.dt,
                y.x[i],
                y.v[i],
                y.e[i],
                y.de[i],
                y.r[i],
                y.dr[i],
                0.0,
                0.0,
                1.0,
                y.a[i] - y.ddr[i],
                bound,
                1.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            )
            v[i], s[i] = inner(seen, of_joint(gains, i), memory[i])
        return torque(y, v), s

    law.__name__ = law.__qualname__ = f"{outer.name}_computed_torque"
    law.__doc__ = f"Computed torque with {outer.label or outer.name} as its outer law, see smc_mujoco.control.outer_law."
    made = law_function(
        joint=True,
        family=outer.family,
        continuous=outer.continuous,
        requires_model=True,
        gains=own,
        memory=outer.memory,
        label=f"{outer.label or outer.name} on computed torque",
    )(law)
    return dataclasses.replace(made, conditions=outer.conditions, accuracy=outer.accuracy)
