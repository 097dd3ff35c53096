"""smc-mujoco identify and excitation: a machine's parameters from its logs, and what to record."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import with_ending

Machine = Annotated[
    str | None,
    typer.Argument(
        metavar="MACHINE",
        help=(
            "FILE.xml:joint+joint; FILE.xml alone takes the joints from the logs' columns. "
            "Or a plant or a rig by its name."
        ),
    ),
]
Logs = Annotated[
    list[Path] | None,
    typer.Argument(metavar="LOG...", help="CSV or npz files of columns, or traces."),
]
Paths = Annotated[
    str | None,
    typer.Option(
        "--for",
        metavar="NAME,...",
        help="Parameters to find, such as shoulder.damping,input_delay,m; "
        "default: for a rig, those that its own records determine; a machine that is no rig has "
        "no default.",
    ),
]
PairsFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Find friction alone, from columns speed and torque, without a machine.",
    ),
]
HeldOut = Annotated[
    Path | None,
    typer.Option(help="A log, or pairs, to check the result on; they are not used to find it."),
]
FoundFigure = Annotated[
    Path | None,
    options.picture(
        "the log with the prediction, the residuals and the friction (with --pairs, the pairs)"
    ),
]
FoundFile = Annotated[
    Path | None,
    typer.Option(
        help="File for the result as a condition, for --condition of other commands; a name that "
        "does not end in .txt gets JSON. Default: found.txt."
    ),
]
Beside = Annotated[
    str | None,
    typer.Option(
        "--condition",
        metavar="NAME|TEXT|FILE",
        help="Effects that the model lacks, such as friction: "
        '"mine: friction=LuGre(0.3, 0.4, 0.1)", "mine: friction=my_parts.py:stribeck()", or a '
        "file with one such line. Numbers that --for names are found; others stay as given.",
    ),
]
Corrected = Annotated[
    bool,
    typer.Option(
        "--corrected",
        help="Halve the simulation's steps until their errors no longer matter, in several times "
        "the time; by default the result is extrapolated to steps of 0.",
    ),
]
Starts = Annotated[
    int,
    typer.Option(
        min=1, help="How many starting points the search may try, if the first fits badly."
    ),
]
StartsSeed = Annotated[int, typer.Option(min=0, help="Seed of these starting points.")]
ModelJoints = Annotated[
    str, typer.Argument(metavar="MACHINE", help="FILE.xml:joint+joint, or a plant by its name.")
]
UMax = Annotated[
    float | None, typer.Option(help="Bound on |u| of each motor, N m or N; default: the model's.")
]
VMax = Annotated[
    float | None,
    typer.Option(help="Bound on the speed of each joint's reference, rad/s or m/s."),
]
Amplitude = Annotated[
    float | None,
    typer.Option(help="Largest travel to each side of the goal, rad or m; default: 0.5 or 0.1."),
]
MotionDuration = Annotated[float, typer.Option(help="Duration of each motion, s.")]
Rate = Annotated[float, typer.Option(help="Samples a second of the log.")]
LogNoise = Annotated[
    float, typer.Option(help="Standard deviation of the log's positions, rad or m.")
]
LogCounts = Annotated[
    float, typer.Option(help="Counts of the encoders, per revolution or per metre; inf for none.")
]
MotionsFigure = Annotated[
    Path | None, options.picture("the motions and the expected errors of each")
]
FIGURE = Path("fit")
REPLAYS = "replays"  # the folder beside the report from which a stopped search goes on
FOUND = Path("found.txt")
MotionFile = Annotated[
    Path | None, typer.Option(help="CSV file of the best motion: t, and r or r_JOINT.")
]


def identify(
    machine: Machine = None,
    files: Logs = None,
    names: Paths = None,
    pairs: PairsFile = None,
    held_out: HeldOut = None,
    columns: options.Columns = None,
    condition: Beside = None,
    figure: FoundFigure = None,
    out: FoundFile = None,
    corrected: Corrected = False,
    starts: Starts = 1,
    seed: StartsSeed = 0,
    full: options.Full = False,
    json: options.Json = None,
) -> None:
    """Estimate a machine's parameters from its logs: friction, armature, delay, masses and more.

    A log may come from any controller, and needs at least 40 rows a second. It has columns t in s,
    and x and u of the joint, or x_JOINT and u_JOINT of each. x is the position (rad or m) as the
    model file counts it. u is what the actuator of the model takes: the force of a motor (N m or
    N), or the set-point of a position servo, counted from the goal (rad or m). If a servo's force
    was logged, add (motor): arm.xml:elbow(motor). You need no first guess.

    Parameters of a joint are named JOINT.damping, .frictionloss, .armature, .stiffness, .gain,
    .offset and .zero: the force is gain times u, plus offset, and zero is what the encoder reads
    where the model counts 0. The delay from command to force is input_delay. A plant's own
    parameters keep the names that they have in the plant, such as m (mass) and grav (gravity); m of
    your own model is the mass of all that moves, in kg. Parameters of a part that --condition adds
    are named FIELD.NAME, such as friction.coulomb. The command prints each with its standard error,
    how well the logs are repeated, and what to doubt. It writes found.txt, which --condition of
    other commands takes, the figure fit.svg, and all of it as fit/report.html. A stopped command
    resumes when you start it again.

    With --pairs you need no machine: give the speed (rad/s or m/s) and torque (N m or N) of one
    joint, in time order. The torque must be that of friction alone, so subtract gravity and inertia
    from the measured torque first.

    Example: smc-mujoco identify arm.xml run1.csv run2.csv --for shoulder.damping,input_delay

    Example: smc-mujoco identify arm.xml run.csv --condition "mine: friction=my.py:stribeck()" --for
    friction.coulomb,friction.speed

    Example: smc-mujoco identify --pairs slow.csv --columns speed=dq4,torque=tau4 --figure friction
    """
    terminal = Terminal(json)
    options.check_files(None, figure, out)
    renamed = options.pairs(columns, "columns", "x_elbow=angle,t=time") or None
    if pairs is not None:
        _alone("--pairs", machine, files, names, condition)
        _from_pairs(pairs, held_out, renamed, figure, out, terminal)
        return
    if machine is None or not files:
        raise ScenarioError("identify needs a machine and its logs, or --pairs FILE")
    with importing():
        from smc_mujoco.answers import answers
        from smc_mujoco.answers.command import PROGRAM
        from smc_mujoco.answers.facts import Fact, NextStep
        from smc_mujoco.answers.templates import said
        from smc_mujoco.identification import identify as identification

    identified = identification.identify(
        machine,
        files,
        options.parsed_names(names) or None,
        held_out=held_out,
        columns=renamed,
        condition=condition,
        corrected=corrected,
        starts=starts,
        seed=seed,
        progress=True,
        folder=(figure or FIGURE).with_suffix("") / REPLAYS,
    )
    terminal.answer(identified, full)
    picture = identified.figure(figure or FIGURE)[0]
    report = identified.to_html(picture.with_suffix("") / "report.html")
    saved = None
    if out is None and identified.is_condition:
        out = FOUND
    if out is not None:
        saved = identified.save(out)
    terminal.note(said(Fact("files", condition=saved, figure=picture, report=report))[1])
    if saved is not None and saved.suffix == FOUND.suffix:
        rig: Any = identified.rig  # the user's own machine
        words = [PROGRAM, "which", rig.plant.argument, "--condition", f"{saved}"]
        step = NextStep(shlex.join([*words, "--quick"]), "finds a law for this machine")
        for line in answers.labelled([answers.next_step(step)]):
            terminal.note(line)
    terminal.finish(identified.about())


def _alone(option: str, *others: Any) -> None:
    """Raise ScenarioError if what belongs to a machine was given beside pairs."""
    if any(others):
        raise ScenarioError(
            f"{option} has friction alone: leave out the machine, its logs, --for and --condition"
        )


def _write(friction: Any, figure: Path | None, out: Path | None, terminal: Terminal) -> None:
    """Write the figure and the file of a friction, and end."""
    if figure:
        terminal.wrote(*friction.figure(figure))
    if out:
        terminal.wrote(friction.save(out))
    terminal.finish(friction.about())


def _from_pairs(
    file: Path,
    held_out: Path | None,
    columns: Mapping[str, str] | None,
    figure: Path | None,
    out: Path | None,
    terminal: Terminal,
) -> None:
    """Find friction in pairs of speed and torque."""
    with importing():
        from smc_mujoco.identification import speed_torque

    read = speed_torque.read_pairs
    held_out_pairs = None if held_out is None else read(held_out, columns)
    friction = speed_torque.identify_friction(*read(file, columns), held_out=held_out_pairs)
    terminal.note(str(friction))
    _write(friction, figure, out, terminal)


def excitation(
    machine: ModelJoints,
    names: Paths = None,
    u_max: UMax = None,
    v_max: VMax = None,
    amplitude: Amplitude = None,
    duration: MotionDuration = 8.0,
    rate: Rate = 500.0,
    noise: LogNoise = 2e-4,
    counts: LogCounts = 4096,
    figure: MotionsFigure = None,
    out: MotionFile = None,
    json: options.Json = None,
) -> None:
    """Recommend a motion to record, from which a machine's parameters can be told apart.

    It compares chirps, sines and staircases within the bounds on the model: how large the error of
    each parameter will be, and which two are hardest to tell apart. Play the best one under any
    controller that tracks it stably, and record t, and x and u of each joint, for `smc-mujoco
    identify`.

    Example: smc-mujoco excitation arm.xml:shoulder --for shoulder.damping,input_delay --out m.csv
    """
    terminal = Terminal(json)
    with importing():
        from smc_mujoco.draw.page import files
        from smc_mujoco.identification import excitation as exciting

    options.check_files(None, *files(figure), out and with_ending(out, ".csv"))
    motions = exciting.excitation(
        machine,
        options.parsed_names(names),
        u_max=u_max,
        v_max=v_max,
        amplitude=amplitude,
        duration=duration,
        rate=rate,
        noise=noise,
        counts=counts,
    )
    terminal.note(str(motions), wrap=True)
    if figure:
        terminal.wrote(*motions.figure(figure))
    if out:
        terminal.wrote(motions.save(out))
        logged = ["t"]
        for quantity in "xu":
            for column in motions.columns:
                logged.append(quantity + column.removeprefix("r"))
        words = f"play it, record {', '.join(logged)}, and run smc-mujoco identify"
        terminal.note(words, wrap=True)
    terminal.finish(motions.about())
