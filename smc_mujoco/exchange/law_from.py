"""One door for laws from elsewhere: code in C, FMUs, linear controllers, policies and other
objects.
"""

import os
from pathlib import Path
from typing import Any, overload

import numpy as np

from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.control.component import Component, Template
from smc_mujoco.exchange.c.law_from_c import law_from_c
from smc_mujoco.exchange.fmu.law_from_fmu import law_from_fmu
from smc_mujoco.exchange.linear_law import MATRICES, POLYNOMIALS, has_attributes, law_from_control
from smc_mujoco.exchange.policy import controller, policy

READERS = {
    ".c": law_from_c,
    ".so": law_from_c,
    ".fmu": law_from_fmu,
    ".onnx": policy,
    ".pt2": policy,
}


@overload
def law_from(  # a template of C or of an FMU, the law of a network
    source: str | os.PathLike[str],
    *,
    name: str | None = None,
    units: str | None = None,
    **options: Any,
) -> Any: ...


@overload
def law_from(
    source: object, *, name: str | None = None, units: str | None = None, **options: Any
) -> Component: ...


def law_from(
    source: Any, *, name: str | None = None, units: str | None = None, **options: Any
) -> Component | Template:
    """Return a law that was made elsewhere, to be run, tuned, compared and scored like any other
    law.

        smc.run(smc.Scenario(plant="duffing", law=smc.law_from(control.tf([40, 100], [0.01, 1]))))
        smc.run(smc.Scenario(plant="duffing", law=smc.law_from(controller.act, units="SI")))

    Args:
      source: what makes the law, and what reads it, with its `options`:

        - the path of a file of C (.c, .so): `smc.exchange.law_from_c`;
        - the path of an FMU (.fmu): `smc.exchange.law_from_fmu`;
        - a transfer function or state-space model of python-control or scipy, matrices (A, B, C,
          D), or the gain K of u = -K x as `control.lqr` returns it:
          `smc.exchange.law_from_control`;
        - an object with a method compute(t, x, xref), as opensmc's controllers, which gives N or N
          m. x is (x, v) and xref (r, r', r''). Each channel of each run has its own copy of an
          object;
        - a callable from an observation to an action, an object with a method `predict`, a torch
          module, or the path of a network (.onnx, .pt2): `smc.policy`, with copies too.
      name: of the law; default: that of the file or object.
      units: of the action of the last kind: "u_max", a fraction of u_max (the default), or "SI", N
        or N m.

    Returns:
      A Law, or of a file of C or an FMU a Template, which called with gains gives one.

    Raises:
      ScenarioError: none of these, units with another kind, or as the function that reads the
        source.
    """
    if name is not None:
        options["name"] = name
    reader = _reader(source)
    if units is not None:
        if reader is not policy:
            raise ScenarioError(
                "units are of a policy's action: leave them out, as a law in C, an FMU, K or "
                "compute gives N or N m"
            )
        options["units"] = units
    return reader(source, **options)


def _reader(source: Any) -> Any:
    if isinstance(source, str | os.PathLike):
        return find("ending of a law's file", Path(source).suffix, READERS)
    linear = has_attributes(source, MATRICES) or has_attributes(source, POLYNOMIALS)
    if linear or isinstance(source, tuple | list | np.ndarray | float | int):
        return law_from_control
    if callable(getattr(source, "compute", None)):
        return controller
    return policy
