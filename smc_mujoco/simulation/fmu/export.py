"""Write a law out as an FMU: FMI 3.0 for Co-Simulation, in source code and as a binary, without Python inside.

An FMU is a zip archive of modelDescription.xml, the sources and a shared library. It contains the law with its gains as
parameters, and on request a surface and a velocity estimator. In double precision it gives the bits of `smc.run`.
"""

import hashlib
import math
import os
import platform
import re
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from smc_mujoco.common.errors import ScenarioError, find, number, shown
from smc_mujoco.common.files import ended, replacing
from smc_mujoco.common.process import TimedOut, timed
from smc_mujoco.control.c import build
from smc_mujoco.control.c.export import writable
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.simulation import coerce
from smc_mujoco.simulation.fmu import controller as inside
from smc_mujoco.simulation.fmu import description
from smc_mujoco.simulation.fmu.controller import Controller
from smc_mujoco.simulation.scenario import Scenario, check_surface

HERE = Path(__file__).parent
HEADERS = ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h")  # of the standard
# No symbols but those of FMI, and none of where it was built: the same law gives the same bytes.
HIDDEN = ("-std=c99", "-fvisibility=hidden", "-s")
SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
MACHINES = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64", "i686": "x86"}
MODELS = ("none", "nominal")


def export_fmu(
    law: Law | Template | str | Scenario,
    path: str | os.PathLike | None = None,
    *,
    surface: Surface | Template | str | None = None,
    velocity: Estimator | Template | str | None = None,
    control_period: float | None = None,
    u_max: float | None = None,
    model: str | None = None,
    joint: str | None = None,
    binary: bool = True,
) -> Path:
    """Write a law as an FMU for Simulink, Modelica and other tools: FMI 3.0, Co-Simulation. Return its path.

    Args:
      law: a Law, its Template, its name, or a Scenario, which then gives surface, velocity, control_period, u_max,
        model and the joint's units.
      path: of the .fmu file. Default: the law's name, in the current folder.
      surface: a Surface or its name. None: the law's own, de + c e.
      velocity: an Estimator or its name. None: the FMU has the velocity as an input, v.
      control_period: s; the law runs this often. Default: 1 ms.
      u_max: bound on |u|, N or N m; the parameter u_max of the FMU. Default: none.
      model: "nominal" gives the FMU the inputs f and g of x'' = f + g u. Default: "nominal" for a law that requires it,
        else "none".
      joint: "hinge" for the units rad and N m, the default, or "slide" for m and N.
      binary: whether the FMU also contains a binary for this machine, compiled by $CC or cc.

    Inputs are x, v unless an estimator replaces it, the reference r, dr, ddr where the law reads it, and what else the
    law reads; outputs are u and s. All gains are tunable parameters.

    Raises:
      ScenarioError: a law of many joints or in C, Python without translation into C, a surface that does not fit, no
        compiler.
    """
    if isinstance(law, Scenario):
        given = {"surface": surface, "velocity": velocity, "control_period": control_period}
        law, about, joint = _of_scenario(law, given | {"u_max": u_max, "model": model, "joint": joint})
    else:
        about = {
            "surface": surface,
            "velocity": velocity,
            "control_period": 1e-3 if control_period is None else control_period,
            "u_max": math.inf if u_max is None else u_max,
            "model": model,
        }
        joint = "hinge" if joint is None else joint
    find("joint", joint, description.JOINTS)
    controller = _controller(law, **about)
    identifier = _identifier(controller.law.name)
    target = ended(path if path is not None else f"{identifier}.fmu", ".fmu")
    files = _files(controller, identifier, joint)
    if binary:
        files |= _binary(files, identifier)
    with replacing(target) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)  # without the time
    return target


def _of_scenario(scenario: Scenario, given: Mapping[str, Any]) -> tuple[Law, dict[str, Any], str]:
    """Return the law, the other arguments of `export_fmu`, and the kind of joint of a scenario."""
    if chosen := [name for name, value in given.items() if value is not None]:
        raise ScenarioError(f"a scenario has its own {chosen[0]}: leave {chosen[0]} out, or give its law instead")
    s, limits = scenario.resolved, set(scenario.limits)
    if len(limits) > 1 or s.feedforward is not None:
        what = "a bound for each channel" if len(limits) > 1 else "a feedforward"
        raise ScenarioError(f"the scenario has {what}, which an FMU has not: give its law, with u_max=")
    about = {
        "surface": s.surface,
        "velocity": s.velocity,
        "control_period": s.control_period,
        "u_max": limits.pop(),
        "model": s.model,
    }
    return s.law, about, "slide" if s.plant.unit == "m" else "hinge"


def _controller(
    law: Law | Template | str,
    surface: Surface | Template | str | None,
    velocity: Estimator | Template | str | None,
    control_period: float,
    u_max: float,
    model: str | None,
) -> Controller:
    """Return the controller, checked. Arguments and errors as in `export_fmu`."""
    surface, estimator = coerce.surface(surface), coerce.velocity(velocity)
    law = writable(law)
    if law.joint:
        raise ScenarioError(f"law {law.name!r} is of many joints: an FMU has a law of one channel")
    if surface is not None:
        check_surface(surface, law)
    if model not in (None, *MODELS):
        raise ScenarioError(f"model is {shown(model)}: give 'none' or 'nominal'")
    if law.requires_model and model == "none":
        raise ScenarioError(f"law {law.name!r} needs the nominal model: leave model out, or give 'nominal'")
    return Controller(
        law=law,
        surface=surface,
        estimator=None if estimator is None or estimator.name == "measured" else estimator,
        period=number("control_period", control_period, above=0.0),
        u_max=number("u_max", u_max, above=0.0, infinite=True),
        modelled=law.requires_model or model == "nominal",
    )


def _identifier(name: str) -> str:
    """Return a law's name as an identifier of C."""
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
    return plain if plain[:1].isalpha() else f"law_{plain}".rstrip("_")


def _files(controller: Controller, identifier: str, joint: str) -> dict[str, str]:
    """Return path in the archive -> text, of all but the binary."""
    code = controller.code()
    listed = inside.variables(controller, code)
    files = {"controller.c": inside.source(listed, controller, code), "law.c": inside.law_file(controller.law)}
    for kind, (slots, text) in code.items():
        if kind != "law":
            files[f"{kind}.c"] = inside.component_file(controller.parts[kind], slots, text)
    files = {"fmu.c": (HERE / "fmu.c").read_text(encoding="utf-8"), **files}
    content = "\0".join([*files.values(), inside.header(listed, controller, identifier, ""), joint])
    token = f"{{{uuid.UUID(bytes=hashlib.sha256(content.encode()).digest()[:16])}}}"
    compiled = list(files)
    files["controller.h"] = inside.header(listed, controller, identifier, token)
    files["smc_fmu.h"] = (HERE / "smc_fmu.h").read_text(encoding="utf-8")
    files["smc_law.h"] = build.HEADER.read_text(encoding="utf-8")
    files |= {name: (HERE / "headers" / name).read_text(encoding="utf-8") for name in HEADERS}
    return {
        "modelDescription.xml": description.model_description(listed, controller, identifier, token, joint),
        "documentation/index.html": description.page(listed, controller, joint),
        "sources/buildDescription.xml": description.build_description(compiled, identifier),
        **{f"sources/{name}": text for name, text in files.items()},
    }


def platform_tuple() -> tuple[str, str]:
    """Return this machine in words of FMI, such as x86_64-linux, and the suffix of its libraries."""
    system, suffix = SYSTEMS.get(sys.platform, (sys.platform, ".so"))
    machine = platform.machine().lower()
    return f"{MACHINES.get(machine, machine)}-{system}", suffix


def _binary(files: Mapping[str, str], identifier: str) -> dict[str, bytes]:
    """Return path in the archive -> the sources as a shared library of this machine."""
    (machine, suffix), command = platform_tuple(), build.compiler()
    with tempfile.TemporaryDirectory(prefix="smc_mujoco-") as folder:
        sources, target = {Path(n).name: t for n, t in files.items() if n.startswith("sources/")}, Path(folder, "out")
        for name, text in sources.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        compiled = [str(Path(folder, name)) for name in sources if name.endswith(".c")]
        try:
            done = timed([*command, *build.FLAGS, *HIDDEN, *compiled, "-o", str(target), "-lm"], 120.0)
        except (OSError, TimedOut):
            raise ScenarioError(
                f"the FMU cannot be compiled, as there is no C compiler {command[0]!r}: install one, set CC, or leave "
                "the binary out (binary=False, --no-binary)"
            ) from None
        if done.returncode or not target.exists():
            lines = [line for line in done.stderr.splitlines() if "error" in line] or ["it says nothing"]
            raise ScenarioError(f"the FMU does not compile, {command[0]} says: {lines[0]}; set another compiler in CC")
        return {f"binaries/{machine}/{identifier}{suffix}": target.read_bytes()}
