"""Writing a law as an FMU:

FMI 3.0 for Co-Simulation, as source code and as a binary, without Python.

An FMU is a zip archive of modelDescription.xml, the sources and a shared library. It contains the
law with its gains as parameters, and on request a surface and a velocity estimator. In double
precision it gives the bits of `smc.run`.
"""

import dataclasses
import hashlib
import math
import platform
import re
import sys
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from smc_mujoco.common.aliases import AnyPath, Data, Fields, Floats
from smc_mujoco.common.constraints import Each, Number, OneOf, Positive, constrained
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import no_room, replacing, scratch, with_ending
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.exchange.c import build
from smc_mujoco.exchange.c.compensation import Compensate, compensate_of
from smc_mujoco.exchange.c.export_c import number_of_joints, with_head, writable
from smc_mujoco.exchange.fmu import contents, description
from smc_mujoco.exchange.fmu.contents import ExportedLaw
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.law_checks import check_surface
from smc_mujoco.simulation.prepare import reference_leads
from smc_mujoco.simulation.scenario import Scenario

FOLDER = Path(__file__).parent
FMI_HEADERS = ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h")  # of the standard
COMPILE_TIMEOUT = 120.0  # s
BOUND = Number(above=0.0, infinite=True)  # on |u| of a joint
# Only the symbols of FMI, and no paths of the build, so that the same law gives the same bytes.
BINARY_FLAGS = ("-std=c99", "-fvisibility=hidden", "-s")
SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
MACHINES = {
    "amd64": "x86_64",
    "x86_64": "x86_64",
    "arm64": "aarch64",
    "aarch64": "aarch64",
    "i686": "x86",
}


@constrained
def law_to_fmu(
    law: Law | Template | str | Scenario,
    path: AnyPath | None = None,
    *,
    surface: Surface | Template | str | None = None,
    velocity: Estimator | Template | str | None = None,
    control_period: Positive | None = None,
    u_max: float | Sequence[float] | None = None,
    model: Annotated[str, OneOf(names=coerce.MODELS[:2])] | None = None,
    joints: int | None = None,
    binary: bool = True,
) -> Path:
    """Write a law as an FMU for Simulink, Modelica and other tools:

        smc.exchange.law_to_fmu("super_twisting", "law.fmu", binary=False)

    FMI 3.0, Co-Simulation. Return its path.

    Args:
      law: a Law, its Template, its name, or a Scenario, which then gives surface, velocity,
        control_period, u_max, model, the number of joints, and its Feedforward with error=0.
      path: of the .fmu file. Default: the law's name, in the current folder.
      surface: a Surface or its name. None: the law's own, de + c e.
      velocity: an Estimator or its name. None: the FMU has the velocity as an input, v.
      control_period: s; the law runs this often. Default: 1 ms.
      u_max: bound on |u|, N or N m; the parameter u_max of the FMU. For many joints also one for
        each. Default: none.
      model: "nominal" gives the FMU the inputs f and g of x'' = f + g u, or those of M, h, g, C and
        J that a law of many joints reads. Default: "nominal" for a law that requires it, else
        "none".
      joints: number of joints of a law of many joints. Default: as many as it has values of a gain.
      binary: whether the FMU also contains a binary for this machine, compiled by $CC or cc.

    Inputs are x, v unless an estimator replaces it, the reference r and dr, and all that the law
    reads besides, such as ddr. Outputs are u and s, and with a Feedforward compensation, which u
    contains. All gains are tunable parameters. Many joints
    have x[1], x[2], M[1,1] and so on.

    Returns:
      The path of the file.

    Raises:
      ScenarioError: a law in C, Python without translation into C, a surface that does not fit, no
        compiler.
    """
    chosen = {
        "surface": surface,
        "velocity": velocity,
        "control_period": control_period,
        "u_max": u_max,
        "model": model,
        "joints": joints,
    }
    exported = exported_law(law, **chosen)
    word = re.sub(r"\W+", "_", exported.law.name, flags=re.ASCII)
    identifier = word.strip("_")
    if not identifier[:1].isalpha():
        identifier = f"law_{identifier}".rstrip("_")  # of C
    if path is None:
        path = f"{identifier}.fmu"
    target = with_ending(path, ".fmu")
    files = _files(exported, identifier)
    if binary:
        files |= _binary(files, identifier)
    with (
        replacing(target) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for name, content in files.items():
            about = zipfile.ZipInfo(name)  # without the time
            archive.writestr(about, content, zipfile.ZIP_DEFLATED)
    return target


def exported_law(law: Any, **options: Any) -> ExportedLaw:
    """Return what is exported of a law or a scenario, checked. Arguments and errors as in
    `law_to_fmu`.
    """
    names = "surface", "velocity", "control_period", "u_max", "model", "joints"
    chosen: Fields = dict.fromkeys(names) | options
    if isinstance(law, Scenario):
        return _exported(law.resolved.law, **_of_scenario(law, chosen))
    return _exported(law, **chosen)


def _of_scenario(scenario: Scenario, chosen: Data) -> Fields:
    """Return a scenario's arguments of `_exported`. `chosen`: those that the user gives."""
    for name, value in chosen.items():
        if value is not None:
            raise ScenarioError(
                f"a scenario has its own {name}: leave {name} out, or give its law instead"
            )
    s = scenario.resolved
    limits = set(scenario.limits)
    what = ""
    if len(limits) > 1 and not s.law.joint:
        what = "a bound for each channel"
    elif s.feedforward_signal is not None:
        what = "a feedforward that is a signal"
    elif s.accelerates:
        what = "a Stepper"
    if what:
        raise ScenarioError(
            f"the scenario has {what}, which an FMU cannot have: give its law, with u_max="
        )
    own = {name: getattr(s, name) for name in ("surface", "velocity", "control_period", "model")}
    own["compensate"] = compensate_of(scenario)
    own |= leads_of(scenario)
    if s.law.joint:
        return own | {"u_max": list(scenario.limits), "joints": s.plant.n, "plant": s.plant}
    return own | {"u_max": limits.pop(), "joints": None}


def _exported(
    law: Any,
    surface: Any,
    velocity: Any,
    control_period: Any,
    u_max: Any,
    model: Any,
    joints: int | None,
    plant: Plant | None = None,
    compensate: Compensate | None = None,
    leads: tuple[float, ...] = (),
    eps: float = 0.0,
) -> ExportedLaw:
    """Return what is exported, checked. Arguments and errors as in `law_to_fmu`."""
    sliding = coerce.coerced_surface("surface", surface, None)
    estimator = coerce.velocity("velocity", velocity, None)
    if estimator is not None and estimator.name == "measured":
        estimator = None
    chosen = writable(law)
    count = number_of_joints(chosen, joints)
    if sliding is not None and count:
        raise ScenarioError(
            f"law {chosen.name!r} is of many joints and has its own surface: leave the surface out"
        )
    if sliding is not None:
        check_surface(sliding, chosen)
    if chosen.requires_model and model == "none":
        raise ScenarioError(
            f"law {chosen.name!r} needs the nominal model: leave model out, or give 'nominal'"
        )
    return ExportedLaw(
        law=chosen,
        surface=sliding,
        estimator=estimator,
        period=control_period or 1e-3,
        u_max=_bounds(math.inf if u_max is None else u_max, count),
        modelled=chosen.requires_model or model == "nominal",
        joints=count,
        plant=plant,
        compensate=compensate,
        leads=leads,
        eps=eps,
    )


def leads_of(scenario: Scenario) -> Fields:
    """Return how far the reference that the law of a scenario sees leads, through plays, as fields
    of an ExportedLaw; none without a play.
    """
    feedforward = scenario.resolved.feedforward
    if not isinstance(feedforward, Feedforward):
        return {}
    right = dataclasses.replace(feedforward, error=0.0)
    leads = reference_leads(dataclasses.replace(scenario, feedforward=right).resolved)
    if not any(leads):
        return {}
    if not scenario.law.joint and len({*leads}) > 1:
        raise ScenarioError(
            "the scenario's Feedforward has plays that differ between its channels, but a law of "
            "one channel is written once for all: give one Backlash for all"
        )
    measured = [0.0] * (scenario.plant.n - len(leads))
    return {"leads": (*leads, *measured), "eps": feedforward.eps}


def _bounds(u_max: float | Sequence[float], joints: int) -> Floats:
    """Return the bound on |u| of each joint, from one for all or one for each."""
    if not (joints and isinstance(u_max, Sequence | np.ndarray)):
        return (BOUND("u_max", u_max),) * max(1, joints)
    if len(u_max) != joints:
        raise ScenarioError(
            f"u_max has {len(u_max)} values for {joints} joints: give one, or {joints}"
        )
    return Each(item=BOUND)("u_max", u_max)


def _files(exported: ExportedLaw, identifier: str) -> dict[str, str]:
    """Return path in the archive -> text, for all files but the binary."""
    listed = contents.variables(exported)
    files = {"fmu.c": (FOLDER / "fmu.c").read_text(encoding="utf-8")} | _sources(exported, listed)
    header = contents.header(listed, exported, identifier, "")
    content = "\0".join([*files.values(), header])
    token = f"{{{uuid.UUID(bytes=hashlib.sha256(content.encode()).digest()[:16])}}}"
    compiled = list(files)
    files |= _headers(exported, identifier, token)
    for name in FMI_HEADERS:
        files[name] = (FOLDER / "headers" / name).read_text(encoding="utf-8")
    placed = {
        "modelDescription.xml": description.model_description(listed, exported, identifier, token),
        "sources/buildDescription.xml": description.build_description(compiled, identifier),
    }
    for name, text in files.items():
        placed[f"sources/{name}"] = text
    return placed


def controller_files(exported: ExportedLaw, identifier: str) -> dict[str, str]:
    """Return name -> text of the C of a controller alone, with its headers."""
    listed = contents.variables(exported)
    return _sources(exported, listed) | _headers(exported, identifier, "")


def _headers(exported: ExportedLaw, identifier: str, token: str) -> dict[str, str]:
    """Return name -> text of the headers of a controller."""
    listed = contents.variables(exported)
    return {
        "controller.h": contents.header(listed, exported, identifier, token),
        "smc_fmu.h": (FOLDER / "smc_fmu.h").read_text(encoding="utf-8"),
        build.HEADER.name: build.HEADER.read_text(encoding="utf-8"),
    }


def _sources(exported: ExportedLaw, listed: Sequence[contents.Variable]) -> dict[str, str]:
    """Return name -> text of the C of a controller."""
    law = with_head(exported.law, "double", *exported.code["law"], exported.joints)
    files = {
        "controller.c": contents.controller_source(
            listed, contents.helpers(exported), contents.body(listed, exported)
        )
    }
    files["law.c"] = f'#include "controller.h"\n{law}'
    for kind, (slots, text) in exported.code.items():
        if kind != "law":
            files[f"{kind}.c"] = contents.component_file(exported.parts[kind], slots, text)
    return files


def platform_tuple() -> tuple[str, str]:
    """Return FMI's name of this machine, such as x86_64-linux, and the suffix of its libraries."""
    system, suffix = SYSTEMS.get(sys.platform, (sys.platform, ".so"))
    machine = platform.machine().lower()
    return f"{MACHINES.get(machine, machine)}-{system}", suffix


def _binary(files: Mapping[str, str], identifier: str) -> dict[str, bytes]:
    """Return path in the archive -> shared library for this machine, compiled from the sources in
    `files`.
    """
    machine, suffix = platform_tuple()
    with scratch() as folder:
        sources = {}
        for path, text in files.items():
            if path.startswith("sources/"):
                sources[Path(path).name] = text
        target = folder / "out"
        with no_room():
            for name, text in sources.items():
                (folder / name).write_text(text, encoding="utf-8")
        compiled = []
        for name in sources:
            if name.endswith(".c"):
                compiled.append(str(folder / name))
        done = build.compiled_library(
            [*BINARY_FLAGS, *compiled], target, "an FMU with a binary", COMPILE_TIMEOUT
        )
        if done.returncode or not target.exists():
            said = build.ERROR.search(done.stderr)
            raise ScenarioError(
                f"the FMU does not compile: {said[0] if said else 'set another compiler in CC'}"
            )
        return {f"binaries/{machine}/{identifier}{suffix}": target.read_bytes()}
