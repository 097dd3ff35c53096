"""Folders around an exported law that compile as they are: a ros2_control package, or a C loop.

The law, its surface, its estimator, its bound and what compensates friction are the C of an FMU;
`smc_loop.c` gives it a start, a step and its parameters by name.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from smc_mujoco.common.aliases import AnyPath
from smc_mujoco.common.constraints import OneOf, Positive, constrained
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import write_text
from smc_mujoco.common.text import joined
from smc_mujoco.control.component import Template
from smc_mujoco.control.estimator import Estimator
from smc_mujoco.control.law import Law
from smc_mujoco.control.surface import Surface
from smc_mujoco.exchange.fmu import contents
from smc_mujoco.exchange.fmu.contents import ExportedLaw
from smc_mujoco.exchange.fmu.export_fmu import controller_files, exported_law
from smc_mujoco.mechanisms.layout import driven_names
from smc_mujoco.simulation.scenario import Scenario

TEMPLATES = Path(__file__).parent / "templates"
GIVEN_BY_A_LOOP = {"x", "v", "r", "dr", "ddr"}  # inputs that a loop has
KINDS = ("ros2", "plain")
CMAKE = """cmake_minimum_required(VERSION 3.16)
project(@package@ C CXX)
set(CMAKE_C_STANDARD 99)
set(CMAKE_CXX_STANDARD 17)

find_package(ament_cmake REQUIRED)
find_package(controller_interface REQUIRED)
find_package(pluginlib REQUIRED)
find_package(std_msgs REQUIRED)

add_library(@package@ SHARED src/smc_controller.cpp @sources@)
target_compile_options(@package@ PRIVATE -ffp-contract=off)
ament_target_dependencies(@package@ controller_interface pluginlib std_msgs)
pluginlib_export_plugin_description_file(controller_interface @package@.xml)
install(TARGETS @package@ LIBRARY DESTINATION lib)
ament_package()
"""
PACKAGE = """<?xml version="1.0"?>
<package format="3">
  <name>@package@</name>
  <version>0.1.0</version>
  <description>The law @law@ of smc_mujoco as a controller of ros2_control</description>
  <maintainer email="you@example.org">You</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <depend>controller_interface</depend>
  <depend>pluginlib</depend>
  <depend>std_msgs</depend>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
PLUGIN = """<library path="@package@">
  <class name="@package@/SmcController" type="@package@::SmcController"
         base_class_type="controller_interface::ControllerInterface">
    <description>The law @law@ of smc_mujoco</description>
  </class>
</library>
"""
MAKE = """CFLAGS = -std=c99 -O2 -Wall -Wextra -ffp-contract=off

controller: main.c @sources@
\t$(CC) $(CFLAGS) main.c @sources@ -o controller -lm
"""


@constrained
def law_to_package(
    law: Law | Template | str | Scenario,
    folder: AnyPath,
    kind: Annotated[str, OneOf(names=KINDS)] = "ros2",
    *,
    surface: Surface | Template | str | None = None,
    velocity: Estimator | Template | str | None = None,
    control_period: Positive | None = None,
    u_max: float | Sequence[float] | None = None,
    joints: int | None = None,
) -> Path:
    """Write a law as a folder that compiles as it is:

        smc.exchange.law_to_package("super_twisting", "my_controller", "plain", u_max=6.0)

    Args:
      law: a Law, its name, or a Scenario, which then gives surface, velocity estimator, control
        period, bound and Feedforward.
      folder: of the package; its name is that of the ROS package.
      kind: "ros2": a package for ros2_control. "plain": C with a main loop.
      surface, velocity, control_period, u_max, joints: as in `law_to_fmu`.

    Returns:
      The path of the folder.

    Raises:
      ScenarioError: as `law_to_fmu`; a law that reads the nominal model, or the joint beside its
        own, which no loop has.
    """
    exported = exported_law(
        law,
        surface=surface,
        velocity=velocity,
        control_period=control_period,
        u_max=u_max,
        joints=joints,
    )
    beyond = contents.inputs(exported) - GIVEN_BY_A_LOOP
    if beyond or exported.of_body:
        needs = joined(sorted(beyond)) if beyond else "the pose of a body"
        raise ScenarioError(
            f"law {exported.law.name!r} reads {needs}, which a loop does not measure: export it as "
            "OUT.c, and fill that in"
        )
    out = Path(folder)
    package = re.sub(r"\W+", "_", out.resolve().name, flags=re.ASCII).strip("_").lower()
    if not package[:1].isalpha():
        package = f"law_{package}"
    for name, text in _files(exported, package, kind, law).items():
        target = out / name
        target.parent.mkdir(parents=True, exist_ok=True)
        write_text(target, text)
    return out


def _files(exported: ExportedLaw, package: str, kind: str, law: Any) -> dict[str, str]:
    """Return path -> text."""
    folder = "src/" if kind == "ros2" else ""
    files = {}
    for name, text in controller_files(exported, package).items():
        files[folder + name] = text
    for name in ("smc_loop.h", "smc_loop.c"):
        files[folder + name] = (TEMPLATES / name).read_text(encoding="utf-8")
    sources = [name for name in files if name.endswith(".c")]
    listed = contents.variables(exported)
    read = contents.inputs(exported)
    interface = "effort"
    if isinstance(law, Scenario) and not law.force_command:
        interface = "position"
    words = {
        "package": package,
        "law": exported.law.name,
        "sources": " ".join(sources),
        "rate": f"{1.0 / exported.period:g}",
        "interface": interface,
        "rest": "0.0",
        "numbers": str(len(listed) + 1),
        "joints": str(max(1, exported.joints)),
        "inputs": _listed(exported, [name for name in contents.COMMON_INPUTS if name in read]),
        "outputs": _listed(exported, ["u"]),
    }
    texts = {"main.c": (TEMPLATES / "main.c").read_text(encoding="utf-8"), "Makefile": MAKE}
    if kind == "ros2":
        controller = (TEMPLATES / "smc_controller.cpp").read_text(encoding="utf-8")
        texts = {
            "CMakeLists.txt": CMAKE,
            "package.xml": PACKAGE,
            f"{package}.xml": PLUGIN,
            "src/smc_controller.cpp": controller,
            "config/controllers.yaml": _parameters(exported, package, interface, _joints(law)),
        }
    for name, text in texts.items():
        files[name] = re.sub(r"@(\w+)@", lambda match: words[match[1]], text)
    return files


def _listed(exported: ExportedLaw, names: Sequence[str]) -> str:
    """Return names of variables of all joints as strings in C."""
    return ", ".join(f'"{name}{place}"' for name in names for place in exported.places)


def _joints(law: Any) -> Sequence[str]:
    """Return the names of the joints that a scenario drives on a user's own robot; () without."""
    if not isinstance(law, Scenario) or not law.plant.is_user_model:
        return ()
    return driven_names(law.plant)


def _parameters(exported: ExportedLaw, package: str, interface: str, joints: Sequence[str]) -> str:
    """Return the file of parameters, with the gains of the export, and the names of joints where as
    many are known.
    """
    count = max(1, exported.joints)
    if len(joints) != count:
        joints = [f"joint{i + 1}" for i in range(count)]
    names = ", ".join(json.dumps(joint) if "/" in joint else joint for joint in joints)
    lines = [
        "controller_manager:",
        "  ros__parameters:",
        f"    update_rate: {1.0 / exported.period:g}",
        f"    {package}:",
        f"      type: {package}/SmcController",
        "",
        f"{package}:",
        "  ros__parameters:",
        f"    joints: [{names}]",
        f"    interface: {interface}",
    ]
    groups: dict[str, list[str]] = {}
    for variable in contents.variables(exported):
        if variable.kind == "SMC_PARAMETER":
            group, _, own = variable.name.rpartition(".")
            name = re.sub(r"\[(\d+)\]$", r"_\1", own)
            groups.setdefault(group, []).append(f"{name}: {float(variable.start)!r}")
    for group, numbers in groups.items():
        if group:
            lines.append(f"    {group}:")
        lines += [f"    {'  ' if group else ''}{line}" for line in numbers]
    return "\n".join([*lines, ""])
