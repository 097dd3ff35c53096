"""Options and arguments that several commands have, and functions that parse them."""

import importlib
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.common.text import real

if TYPE_CHECKING:
    from smc_mujoco.control.law import Law
    from smc_mujoco.mechanisms.hardware.part import Actuator
    from smc_mujoco.simulation import conditions as named
    from smc_mujoco.simulation.grid import Starts

COMMA = re.compile(r",(?![^(]*\))")  # a comma outside brackets
GAINS_HELP = (
    "Your own gains: pid(kp=50,ki=50,kd=8). Your own file: my_law.py, my_laws.py:name, a "
    "gains.json written by `smc-mujoco tune --out`, or my_law.py(gains.json)."
)


def picture(contents: str) -> Any:
    """Return an option for the file of a figure that shows `contents`."""
    return typer.Option(
        metavar="PICTURE",
        help=f"Also draw {contents}, as a PDF if PICTURE ends in .pdf, otherwise as .svg and .png.",
    )


def conditions_by_default(default: str) -> Any:
    """Return the option --condition of a command that has these conditions by default."""
    return typer.Option(
        "--condition",
        metavar="CONDITION",
        autocompletion=CONDITIONS,
        help="Conditions from `smc-mujoco list`, separated by commas, each tried alone; "
        "noise+encoder is one that has both. "
        "Give each condition of your own in a separate --condition: "
        '"worn gear: friction=Coulomb(0.05)" or a file with one condition on each line. '
        f"May be repeated. Default: {default}.",
        show_default=False,
    )


def _completing(module: str, name: str) -> Callable[[str], list[str]]:
    """Return a function that completes a text such as "a,b" or "a+b" in a shell, with names from a
    module.
    """

    def complete(incomplete: str) -> list[str]:
        names = getattr(importlib.import_module(f"smc_mujoco.{module}"), name)
        choices: Any = names() if callable(names) else names
        last = re.split("[,+]", incomplete)[-1]
        completed = []
        for word in choices:
            if word.startswith(last):
                completed.append(incomplete + word[len(last) :])
        return completed

    return complete


WORDS = _completing("answers.explain", "glossary")
CONDITIONS = _completing("simulation.conditions", "NAMED")
PLANTS = _completing("mechanisms.plant", "plants")
LAWS = _completing("control.law", "all_laws")
SCENES = _completing("studies.scene", "scenes")

Columns = Annotated[
    str | None,
    typer.Option(
        metavar="NAME=COLUMN,...",
        help="Columns that have other names in your file, as EXPECTED=YOURS: x=arm_angle reads x "
        "from the column arm_angle.",
    ),
]
Condition = Annotated[
    str,
    typer.Option(
        "--condition",
        metavar="CONDITION",
        autocompletion=CONDITIONS,
        help='The condition of all runs: encoder, noise+encoder, "worn gear: '
        'friction=Coulomb(0.05)" or a file with one.',
    ),
]
Defaults = Annotated[
    bool,
    typer.Option("--allow-defaults", help="Name a winner even if a rival has default gains."),
]
Disturbance = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        help="Bound on |d| of a further disturbance, N or N m; default: none if you bound "
        "anything.",
    ),
]
Folder = Annotated[
    Path,
    typer.Option(
        metavar="FOLDER", help="Folder for gains and runs; a stopped command resumes from it."
    ),
]
GainValues = Annotated[
    str,
    typer.Option(metavar="NAME=VALUE,...", help="Gains; those left out have the law's defaults."),
]
Gains = Annotated[
    str,
    typer.Option(
        help="Which of the package's gains to use: tuned (for error and variation of u), tracking "
        "(for error alone), study (chosen for the package's first study) or default (from the "
        "law's file)."
    ),
]
Joints = Annotated[
    int | None,
    typer.Option(
        help="Number of joints of a law of many joints; default: number of values of a gain."
    ),
]
Json = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.json", help="Also write the result to a file; - is standard output."
    ),
]
Full = Annotated[
    bool,
    typer.Option("--full", help="Print all tables with their intervals in place of the answer."),
]
OneLaw = Annotated[str, typer.Option("--law", autocompletion=LAWS, help=f"A law. {GAINS_HELP}")]
LawToTune = Annotated[
    str,
    typer.Option(
        "--law",
        metavar="LAW|FILE",
        autocompletion=LAWS,
        help="A law, such as pid, or a file that defines one. Gains in brackets, such as "
        "pid(kp=50,ki=50,kd=8), do not fix anything: they are a baseline that the tuned gains are "
        "compared with. The exception is a gain of 0, which stays 0.",
    ),
]
Laws = Annotated[
    list[str] | None,
    typer.Option(
        "--law",
        metavar="LAW|FILE",
        autocompletion=LAWS,
        help=f"Laws from `smc-mujoco list`, separated by commas. {GAINS_HELP} May be repeated.",
        show_default=False,
    ),
]
Plants = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="PLANT",
        autocompletion=PLANTS,
        help="Plants from `smc-mujoco list`, or your own: FILE.xml:joint+joint. Separate several "
        "by commas or spaces. Default: inverted_pendulum, van_der_pol, duffing and the two "
        "pendulum networks; fewer with --quick.",
        show_default=False,
    ),
]
PlantName = Annotated[
    str,
    typer.Argument(
        metavar="PLANT",
        autocompletion=PLANTS,
        help="A plant from `smc-mujoco list`, or joints of your own .xml or .urdf, such as "
        "arm.xml:shoulder+elbow.\n\n"
        "- The goal is the keyframe named home; if there is none, the file's only keyframe, if it "
        "has a name; otherwise the model's default pose (qpos0). Add @NAME for another keyframe, "
        "as in arm.xml:elbow@up, or @ alone for the default pose.\n\n"
        "- The other joints are held by their own servos or motors; those without an actuator move "
        "freely. Add +locked to weld all other joints, or +file to free those that have a "
        "motor but no servo.\n\n"
        "- Brackets after a joint hold its options. elbow(u_max=9,x0=0.2) sets the bound on u and "
        "the start. (motor) puts an ideal motor in place of the file's actuator. (servo) "
        "declares that the file's actuator is a position servo, and (servo=false) that it is not; "
        "neither changes it. (partner=pole) names a passive joint, such as the "
        "pole on a cart, whose position and velocity the law also reads. A joint with (measured) "
        "is read, not driven.",
    ),
]
Quick = Annotated[
    bool,
    typer.Option(
        "--quick",
        help="Fewer and shorter runs, for a first answer in minutes. Tuning takes extra time.",
    ),
]
Relevant = Annotated[
    float,
    typer.Option(
        "--relevant", help="Smallest difference that counts, as a share of the larger value."
    ),
]
SceneName = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        autocompletion=SCENES,
        help="A scene from `smc-mujoco list`, or a scene file.",
    ),
]
Threads = Annotated[
    int | None, typer.Option(min=1, help="Number of parallel simulations; default: one per core.")
]
Device = Annotated[
    str,
    typer.Option(
        help="Where the many runs of a search are computed: cpu, or cuda for an NVIDIA card."
    ),
]
Executor = Annotated[
    str | None,
    typer.Option(
        metavar="dask://HOST:PORT",
        help="A dask scheduler, whose workers do the searches and runs; default: threads here.",
    ),
]
POSITIONS = (
    "Initial joint positions, rad or m, absolute and not relative to the goal: one number for all "
    "joints, or one for each, such as 0.3,-0.2; default: the plant's."
)
X0 = Annotated[
    str | None,
    typer.Option(
        "--x0",
        metavar="X[,X...]",
        help=f"{POSITIONS} Each run starts within 20 % of these.",
    ),
]
X0Exactly = Annotated[
    str | None,
    typer.Option("--x0", metavar="X[,X...]", help=f"{POSITIONS} All runs start at these."),
]


def parsed_names(texts: str | Sequence[str] | None, default: Sequence[str] = ()) -> list[str]:
    """Return the names in a text such as "a,b", or in several, or the default if there is none."""
    if texts is None:
        return list(default)
    parts = []
    for text in [texts] if isinstance(texts, str) else texts:
        of_text = list(filter(None, map(str.strip, COMMA.split(text))))
        if not of_text:
            raise ScenarioError(f"{shown(text)} holds no name: give names, such as pid,adrc")
        parts += of_text
    return parts


def plants(texts: Sequence[str] | None, default: Sequence[str] = ()) -> list[str]:
    """Return the names of plants in texts, or the default; a law's name is refused."""
    from smc_mujoco.control.law import all_laws

    chosen = parsed_names(texts, default)
    for name in chosen:
        if name in all_laws():
            raise ScenarioError(f"{name!r} is a law, not a plant: give it as --law {name}")
    return chosen


def check_files(json: Path | None, *others: Path | None) -> None:
    """Check the .json file and the other files of a command, before minutes are spent."""
    from smc_mujoco.common.files import with_ending, writable

    writable(json and with_ending(json, ".json"), *others)


def pairs(text: str | None, option: str, example: str) -> dict[str, str]:
    """Return name -> value from the text of an option, such as "theta=arm_angle,t=time"; {} for
    None.
    """
    values = {}
    for pair in parsed_names(text):
        name, _, value = map(str.strip, pair.partition("="))
        if not (name and value):
            raise ScenarioError(f"{option} {shown(pair)} cannot be read: write it as {example}")
        if name in values:
            raise ScenarioError(f"{option} has {name} twice: leave out one of them")
        values[name] = value
    return values


def numbers(text: str | None, option: str, example: str) -> dict[str, float]:
    """Return name -> number from the text of an option such as "M=5,b=8"; {} for None."""
    values = {}
    for name, value in pairs(text, option, example).items():
        try:
            values[name] = real(value)
        except ValueError:
            raise ScenarioError(
                f"{option} {name}={value} is no number: write it as {example}"
            ) from None
    return values


def parsed_laws(
    texts: str | Sequence[str] | None, default: Sequence[str] = (), of_rig: "Sequence[Law]" = ()
) -> "list[str | Law]":
    """Return the laws in texts, see `control.from_text`.

    Those of a rig come before others of their names.
    """
    from smc_mujoco.control import from_text

    rig_laws = {law.name: [law] for law in of_rig}
    chosen = []
    for text in parsed_names(texts, default):
        chosen += rig_laws.get(text) or from_text.laws_of_text(text)
    return chosen


def parsed_law(text: str) -> "str | Law":
    """Return the one law in a text. The name of a law of the library stays a name."""
    from smc_mujoco.control import from_text

    laws_of_text = from_text.laws_of_text(text)
    if len(laws_of_text) == 1:
        return laws_of_text[0]
    return from_text.law(text)


def conditions(texts: Sequence[str] | None) -> "list[named.Condition]":
    """Return the conditions of the option --condition: names and files, as a,b, or a text with a
    colon.
    """
    from smc_mujoco.simulation.conditions import find_conditions

    chosen = []
    for text in texts or ():
        for part in [text] if ":" in text else parsed_names(text):
            chosen += find_conditions(part)
    return chosen


def compared_laws(
    texts: Sequence[str] | None, plants: Sequence[str], gains: str
) -> "Sequence[str | Law] | None":
    """Return the laws of the option --law of `compare`; None if it is not given; all general ones
    for "all".
    """
    from smc_mujoco.control import gain_sets
    from smc_mujoco.simulation.conditions import PLANTS

    if texts is None:
        return None
    if list(texts) == ["all"]:
        if gains == "tuned":
            return gain_sets.general()
        return gain_sets.general_laws(plants or PLANTS, gains)
    return parsed_laws(texts)


def parsed_starts(x0: str | None) -> "Starts | None":
    """Return the initial states of the option --x0; None for each plant's own."""
    from smc_mujoco.simulation import grid

    if x0 is None:
        return None
    try:
        values = list(map(real, x0.split(",")))
    except ValueError:
        raise ScenarioError(
            f"--x0 is {x0!r}: give a number, or one for each joint, such as 0.3,-0.2"
        ) from None
    return grid.starts(values[0] if len(values) == 1 else values)


def actuator(text: str) -> "tuple[Actuator, ...]":
    """Return a drive or gear from "lag:0.01", or several from "dcmotor+lag:0.01"; numbers are in
    the fields' order. Your own is "my_parts.py:dead_zone(zone=0.1)".
    """
    from smc_mujoco.common.registry import subclasses
    from smc_mujoco.common.scripts import WITHIN
    from smc_mujoco.mechanisms.hardware import backlash, drives  # noqa: F401
    from smc_mujoco.mechanisms.hardware.part import Actuator
    from smc_mujoco.simulation.condition_text import read_fields

    kinds: dict[str, type[Actuator]] = {}
    for kind in subclasses(Actuator):
        kinds[kind.__name__.lower()] = kind
    parts = []
    for part in map(str.strip, text.split("+")):
        if WITHIN.match(part):
            try:
                fields = read_fields(f"actuator={part}")
            except SyntaxError:
                fields = {}
            if list(fields) != ["actuator"]:
                raise ScenarioError(
                    f"actuator {shown(part)} cannot be read: write it as my_parts.py:name(gap=0.1)"
                )
            parts.append(fields["actuator"])
            continue
        name, _, numbers = part.partition(":")
        kind = find("actuator", name.strip().lower().replace("_", ""), kinds)
        try:
            parts.append(kind(*map(real, filter(None, numbers.split(",")))))
        except (TypeError, ValueError):
            raise ScenarioError(
                f"actuator {shown(part)} cannot be read: write it as lag:0.01"
            ) from None
    return tuple(parts)


def only_for(ctx: typer.Context, names: Iterable[str], allowed: bool, kind: str) -> None:
    """Raise ScenarioError if one of these options, which are only for a kind of call, was given
    where not `allowed`.
    """
    for name in () if allowed else names:
        if str(ctx.get_parameter_source(name)).endswith("COMMANDLINE"):
            flags = next(
                parameter.opts for parameter in ctx.command.params if parameter.name == name
            )
            raise ScenarioError(f"{flags[0]} is for {kind}")
