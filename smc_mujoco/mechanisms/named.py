"""Plants as users name them: by a name of the library, or by a model and the joints to control.

as_plant("duffing")
as_plant("arm.xml:shoulder,elbow")
as_plant("cart.urdf:slider(motor,partner=pole,u_max=20,x0=0.5)")
as_plant("drone.xml:body@hover")
as_plant("robot.xml:knee(motor)@home+held")
as_plant("arm.urdf:elbow(motor)@{shoulder=-1.57}+held")
as_plant("cart.xml:slide+hinge(measured)")

A text is short, so what it leaves out is chosen and said: the pose is the file's keyframe, and
joints with other motors are held there.
"""

import dataclasses
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from smc_mujoco.common.errors import (
    ScenarioError,
    ScenarioWarning,
    find,
    one_line,
    shown,
    users_stacklevel,
)
from smc_mujoco.common.text import counted, real
from smc_mujoco.mechanisms.custom import mjcf
from smc_mujoco.mechanisms.custom.channels import Channel, joints_of
from smc_mujoco.mechanisms.custom.others import OTHERS, limp, usual_keyframe
from smc_mujoco.mechanisms.custom.plant_from import plant_from
from smc_mujoco.mechanisms.plant import Plant, plant

MODEL = re.compile(
    r"(?P<path>.*\.(xml|mjcf|urdf))(?::(?P<joints>.*?)(?:@(?P<keyframe>[^@()]*))?)?",
    re.DOTALL | re.IGNORECASE,
)
BETWEEN_JOINTS = re.compile(r"[+,](?![^(]*\))")
MEASURED = re.compile(r"\s*([^(]*?)\s*\(\s*measured\s*\)\s*", re.DOTALL)
JOINT = re.compile(r"\s*(?P<joint>[^(]*?)\s*(?:\((?P<fields>.*)\))?\s*", re.DOTALL)


def as_plant(value: object) -> Plant:
    """Return a plant: itself, by its name, or from "FILE.xml:joint,joint"."""
    if isinstance(value, str) and value.lstrip().startswith("<"):
        raise ScenarioError(
            "plant is the text of a model: give smc.plant_from(text, channels=['joint'])"
        )
    machine = from_text(value) if isinstance(value, str) else value
    if not isinstance(machine, Plant):
        raise ScenarioError(
            f"plant is {shown(machine)}: give a name that smc.plants() lists, smc.plant(...), "
            "or FILE.xml:joint,joint"
        )
    return machine


def jointed(value: object, analysis: str) -> Plant:
    """Return a plant as `as_plant` does. Refuse a free body, whose channels are no joints, to an
    analysis of joints.
    """
    machine = as_plant(value)
    if machine.pose:
        raise ScenarioError(
            f"{machine.name} is a free body, and {analysis} is for joints: give another plant"
        )
    return machine


def from_text(text: str, folder: Path = Path(), **values: Any) -> Plant:
    """Return a plant by its name and parameters, or from FILE.xml:joint,joint in a folder and
    `plant_from`'s arguments.

    A comma or a plus sign is between the joints: plants are separated by commas on the command
    line. Fields of a `Channel` follow a joint in brackets: lift(motor,u_max=30,x0=0.2); one that is
    only measured is hinge(measured). The law of a channel and its reference are those of the
    scenario. The keyframe of the start follows after @, or a pose in braces, as
    @{shoulder=-1.57;wrist=0.3}; nothing after it is the pose of the file.
    What other joints do is last, as +held. For what is left out see `_left_out`.
    """
    if not (model := MODEL.fullmatch(text)):
        if set(text) & set(":./\\"):
            file = text.partition(":")[0]
            raise ScenarioError(
                f"plant {text!r}: {file!r} ends in none of .xml, .mjcf and .urdf: "
                "give FILE.xml:joint, of a xacro what xacro FILE > FILE.urdf writes"
            )
        return plant(text, **values)
    rest, _, what_others_do = text.rpartition("+")
    if what_others_do.strip() in OTHERS:
        return from_text(rest, folder, **{"others": what_others_do.strip()} | values)
    path = model["path"]
    texts = BETWEEN_JOINTS.split(model["joints"] or "")
    joints = list(filter(str.strip, texts))
    measured = []
    channels = {}
    for joint in joints:
        if item := MEASURED.fullmatch(joint):
            measured.append(item[1])
        else:
            name, channel = _channel(joint)
            channels[name] = channel
    if len(channels) + len(measured) < len(joints):
        raise ScenarioError(f"plant {text!r} names a joint twice: give each once")
    if measured:
        values = {"measured": measured} | values
    start = model["keyframe"]
    if start is not None and start.strip().startswith("{"):
        values = {"pose": _pose(start.strip())} | values
    elif start is not None:
        values = {"keyframe": start.strip() or None} | values
    source = mjcf.model_source(folder / path)
    if channels:  # without one, an error names the joints
        named = [(name, channel or Channel()) for name, channel in channels.items()]
        values = _left_out(source, [*joints_of(tuple(named)), *measured], values) | values
    return plant_from(source, channels or None, **values)


def _left_out(source: mjcf.ModelSource, seen: Sequence[str], given: dict) -> dict[str, str]:
    """Return values of `plant_from` that a text does not give, and say so: the file's keyframe, the
    only one or "home"; and motors that hold the joints that are not `seen`.
    """
    taken = {}
    spec = source.spec()
    if not set(seen) <= {joint.name for joint in spec.joints}:
        return taken  # an error follows
    starts = given.keys() & {"keyframe", "pose"}
    if not starts and (keyframe := usual_keyframe(spec)):
        taken["keyframe"] = keyframe
        _say(
            f"the goal of {source.label} is its keyframe {keyframe!r}: @{keyframe} after the "
            "joints says so without this line, and @ alone takes the pose of the file"
        )
    elif not starts and [key.name for key in spec.keys] == [""]:
        _say(
            f"{source.label} has a keyframe without a name, and runs start and end in the pose of "
            "the file: give the keyframe a name to start there, or write @ after the joints to say "
            "so without this line"
        )
    if "others" not in given and (idle := limp(spec, seen)):
        taken["others"] = "held"
        _say(
            f"nothing commands {counted(len(idle), 'motor')} of {source.label} "
            f"({one_line(', '.join(idle))}), so a stiff PD holds each joint in place: +held after "
            "the joints says so without this line, +locked welds them, +file leaves them free"
        )
    return taken


def _pose(text: str) -> dict[str, float]:
    """Return joint -> position of a text such as "{shoulder=-1.57;wrist=0.3}"."""
    pose = {}
    for item in filter(str.strip, re.split("[;,]", text.strip("{}"))):
        joint, _, value = (part.strip() for part in item.partition("="))
        pose[joint] = _number(f"pose of {joint}", value)
    return pose


def _say(sentence: str) -> None:
    warnings.warn(sentence, ScenarioWarning, users_stacklevel())


def _channel(text: str) -> tuple[str, Any]:
    """Return a joint and its Channel from a text such as "lift(motor,u_max=30)"."""
    read = JOINT.fullmatch(text)
    if read is None:
        raise ScenarioError(
            f"channel {text!r} cannot be read: write it as lift(motor,u_max=30,x0=0.2)"
        )
    fields: dict[str, Any] = {}
    options = {}
    for field in dataclasses.fields(Channel):
        if field.name not in ("law", "reference"):
            options[field.name] = field
    for item in filter(str.strip, (read["fields"] or "").split(",")):
        name, _, value = (part.strip() for part in item.partition("="))
        find(f"field of channel {read['joint']!r}", name, options)
        if name in ("motor", "servo"):
            fields[name] = {"": True, "true": True, "false": False}.get(value.lower(), value)
        elif name == "partner":
            fields[name] = value
        else:
            fields[name] = _number(f"{name} of channel {read['joint']!r}", value)
    return read["joint"], Channel(**fields) if fields else None


def _number(what: str, text: str) -> float:
    try:
        return real(text)
    except ValueError:
        raise ScenarioError(f"{what} is {text!r}: give a number") from None
