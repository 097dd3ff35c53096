"""Commands that ask one question about laws on a plant, and answer it by many runs."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import real

if TYPE_CHECKING:
    from smc_mujoco.control.law import Law
    from smc_mujoco.mechanisms.plant import Plant as Machine
    from smc_mujoco.robustness.uncertainty import Uncertainty
    from smc_mujoco.simulation.scenario import Scenario

BOUNDS = (
    "Bounds of `smc.Uncertainty`. Ranges: delay=0:0.01 (s), friction=0:0.1 (N or N m), "
    "encoder=2048:32768 (counts), and what is added to a plant, as payload=0:2 (kg). Numbers: "
    "slope (of d, per s), position_noise, velocity_noise, hold (how long a measurement error stays "
    "the same, s), jitter (s), x0 (a share of it). Factors: mass=0.7:1.3, friction_scale=0.5:2, "
    "bound=0.5:1 (on u_max), other parameters of the plant"
)
Bound = Annotated[str | None, typer.Option(metavar="NAME=BOUND,...", help=f"{BOUNDS}.")]
BoundOrPeriod = Annotated[
    str | None,
    typer.Option(
        metavar="NAME=BOUND,...", help=f"{BOUNDS}, and period=1:4 (on the control period)."
    ),
]
Metric = Annotated[
    str, typer.Option(help="The score to look at, any of `smc-mujoco list metrics`; more is worse.")
]
QUICK_MARGINS = {  # defaults of `margins --quick`
    "plants": ["inverted_pendulum", "duffing"],
    "laws": ["observer_free", "classical", "adaptive", "super_twisting"],
    "kinds": ["delay", "disturbance"],
}


Objective = Annotated[
    str, typer.Option(help="balanced: error and variation of u; tracking: error alone.")
]
Budget = Annotated[
    int,
    typer.Option(
        min=1,
        help="How many sets of gains a search may try, for each gain to be tuned: 64 allows 128 "
        "for a law with two gains.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.json",
        help="Also write gains, history and provenance to a file, and each search beside it.",
    ),
]
Condition = Annotated[list[str] | None, options.conditions_by_default("the seven named above")]
Limits = Annotated[
    str | None,
    typer.Option(
        "--need",
        help="Limits that the gains keep, separated by commas: no-overshoot, overshoot<10 (in % of "
        "the way to the goal), calm (u rests where nothing moves).",
    ),
]


def tune(
    plant: options.PlantName,
    law: options.LawToTune,
    objective: Objective = "balanced",
    searches: Annotated[int, typer.Option(min=1, help="Independent searches.")] = 12,
    budget: Budget = 64,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the searches and of the noise.")] = 0,
    out: Out = None,
    condition: Condition = None,
    x0: options.X0 = None,
    json: options.Json = None,
    threads: options.Threads = None,
    device: options.Device = "cpu",
    needs: Limits = None,
    full: options.Full = False,
) -> None:
    """Tune a law for a plant, by a rule that is the same for every law.

    Each gain is searched over at least three decades around a value that follows from its unit and
    the plant. The objective is time-weighted error plus weighted variation of u, summed over runs
    of 5 s in seven conditions: nominal, noise, delay, a sine and a constant disturbance, 30 % more
    and 30 % less mass. Each search begins with its own gains, and has its own initial states and
    noise, so the spread of the results shows how much is chance. The same seed gives the same
    gains. With --out each search is kept in the folder FILE-searches, from which a stopped command
    resumes.

    Example: smc-mujoco tune duffing --law observer_free --out duffing.json

    Example: smc-mujoco tune arm.xml:elbow --law pid --condition "mine:
    friction=my_parts.py:stribeck(static=0.3)"
    """
    with importing():
        from smc_mujoco.analysis.tuning import search

    options.check_files(out)
    terminal = Terminal(json)
    start = options.parsed_starts(x0)
    tested = options.conditions(condition) or None
    tuned = search.tune(
        plant,
        law,
        budget,
        seed,
        objective,
        threads,
        True,
        tested,
        start,
        searches=searches,
        out=out and out.with_name(f"{out.stem}-searches"),
        device=device,
        needs=needs,
    )
    terminal.answer(tuned, full)
    if out:
        terminal.wrote(tuned.save(out))
    terminal.finish()


Kinds = Annotated[
    str | None,
    typer.Option(
        "--kind",
        help="Any of delay, disturbance, friction, mass, noise, blow, jitter, missed and "
        "loss, separated by commas; default: the first five.",
    ),
]
Quick = Annotated[
    bool,
    typer.Option(
        "--quick",
        help="Shorter runs and coarser results. Takes 2 plants, 4 laws and 2 kinds of margin "
        "unless you name them.",
    ),
]


def margins(
    plants: options.Plants = None,
    law: options.Laws = None,
    kinds: Kinds = None,
    gains: options.Gains = "tuned",
    quick: Quick = False,
    condition: options.Condition = "nominal",
    x0: options.X0Exactly = None,
    figure: Annotated[Path | None, options.picture("the margins")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
    device: options.Device = "cpu",
    full: options.Full = False,
) -> None:
    """Find the largest delay, friction, noise and so on that a law tolerates: the error must still
    end below 5 % of its initial value, in runs of 10 s, or 5 s with --quick.

    The delay of u is in s; a constant disturbance and dry friction are in N or N m. Mass is a
    multiple of the nominal mass. Noise is the standard deviation of the position sensor's noise, in
    rad or m; the velocity sensor has five times that number, in rad/s or m/s. A blow lasts 5 ms and
    comes halfway through the run; its momentum is in N s or N m s. Jitter is a share of the control
    period. Missed is the share of samples that are missed. Loss is the fraction of its force that
    each actuator loses. For laws that can be linearised, the column "theory" has the stability
    limit of the linear loop. A law may tolerate more than that, with a small sustained oscillation.
    A law of the package has the gains of its first search; "all sets" is the range over those of
    all its searches.

    Without --law, every law with shipped gains is tried. On a model of your own, give laws with
    their gains. A law from your own file has its default gains, so tune it first (smc-mujoco tune).

    Example: smc-mujoco margins duffing --law observer_free,classical --kind delay
    """
    with importing():
        from smc_mujoco.common.progress import bar
        from smc_mujoco.control import gain_sets
        from smc_mujoco.draw.page import files
        from smc_mujoco.mechanisms.named import as_plant
        from smc_mujoco.robustness.margin_kinds import KINDS
        from smc_mujoco.robustness.margins import margins as search
        from smc_mujoco.simulation.conditions import PLANTS

    terminal = Terminal(json)
    options.check_files(None, *files(figure))
    usual = QUICK_MARGINS if quick else {"plants": PLANTS, "laws": gain_sets.LAWS, "kinds": KINDS}
    machines = list(map(as_plant, options.plants(plants, usual["plants"])))
    chosen = options.parsed_laws(law, usual["laws"])
    kind = options.parsed_names(kinds, usual["kinds"])
    with bar("margins") as progress:
        results = search(
            machines,
            chosen,
            kind,
            gains,
            quick,
            threads,
            progress.reached,
            condition,
            options.parsed_starts(x0),
            device,
        )
    terminal.answer(results, full)
    if figure:
        results.figure(figure)
        terminal.wrote(*files(figure))
    terminal.finish(list(map(dataclasses.asdict, results)))


Plant = Annotated[
    str,
    typer.Argument(
        metavar="PLANT|RIG",
        autocompletion=options.PLANTS,
        help="A plant, FILE.xml:joint+joint, or a rig's sets.",
    ),
]
Duration = Annotated[
    float,
    typer.Option(help="Duration of the runs, s; the error of the first quarter does not count."),
]
WorstBudget = Annotated[
    int | None, typer.Option(min=1, help="Runs of a search; default: about 10 s a law.")
]


def worst(
    plant: Plant,
    law: options.Laws = None,
    disturbance: options.Disturbance = None,
    bound: Bound = None,
    metric: Metric = "rms_error",
    gains: options.Gains = "tuned",
    condition: options.Condition = "nominal",
    duration: Duration = 8.0,
    budget: WorstBudget = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    figure: Annotated[Path | None, options.picture("the worst runs")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
    device: options.Device = "cpu",
    full: options.Full = False,
) -> None:
    """Search for the worst case of each law within bounds that you give, instead of sampling at
    random.

    The search varies only what you bound; all else is as in the condition. If you bound nothing, it
    varies friction, if there is any, by 50 %. It also varies what the plant declares as uncertain,
    such as an arm's payload, or, if nothing is declared, a disturbance up to a sixth of the weakest
    drive's force. On a rig, such as qube_servo, the adversary also chooses a parameter set. The
    search is the same for all laws; there may be worse than it finds.

    The column "worst found" has the error of the worst run, and "median" the median error of as
    many random runs within the bounds. Laws are ordered by the worst. A line below the table says
    where the bounds go beyond the theorem of a law. A law from your own file has its default gains,
    so tune it first (`smc-mujoco tune`).

    Example: smc-mujoco worst duffing --law classical,super_twisting,observer_free --disturbance 2
    --bound mass=0.7:1.3

    Example: smc-mujoco worst panda --law computed_torque_sliding --gains default --bound
    payload=0:2
    """
    with importing():
        from smc_mujoco.draw.page import files
        from smc_mujoco.robustness.worst_case import WorstCases, worst_case

    terminal = Terminal(json)
    within = _within(disturbance, bound)
    options.check_files(None, *files(figure))
    cases = _attacked_cases(plant, law, condition, duration, gains)
    attacks = []
    for attacked in cases:
        attacks.append(
            worst_case(
                attacked, metric, within, budget, seed, threads, progress=True, device=device
            )
        )
    results = WorstCases(attacks)
    terminal.answer(results, full)
    terminal.finish([case.about() for case in results])
    if figure:
        results.figure(figure)
        terminal.wrote(*files(figure))


def sensitivity(
    plant: options.PlantName,
    law: options.OneLaw = "observer_free",
    disturbance: options.Disturbance = None,
    bound: BoundOrPeriod = None,
    metric: Metric = "rms_error",
    gains: options.Gains = "tuned",
    condition: options.Condition = "nominal",
    duration: Annotated[float, typer.Option(help="Duration of the runs, s.")] = 5.0,
    points: Annotated[
        int | None,
        typer.Option(
            min=8, help="Points, a power of 2; default: as many as take about 20 s of a core."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the points.")] = 0,
    figure: Annotated[Path | None, options.picture("the indices and the runs")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
    device: options.Device = "cpu",
    full: options.Full = False,
) -> None:
    """Find what breaks a law: how much of a score's variance each uncertainty explains, and where
    runs fail.

    Mass, friction, delay, noise and the like vary together within bounds. The column "alone" has
    the share of the score's variance that an axis explains by itself, and "with others" also has
    what it does together with others. Below the table stand the axis that explains most, where runs
    fail, and which axis to narrow first.

    If you give no bounds, they are: mass x 0.7 to 1.3, delay up to 20 control periods, friction up
    to a twentieth of what the weakest drive gives, noise up to 1 mrad or 1 mm, encoders of 2^11 to
    2^15 counts, half to all of u_max, and a control period up to 4 times as long.

    Example: smc-mujoco sensitivity duffing --law super_twisting --bound delay=0:0.02,mass=0.7:1.3
    --figure breaks.png
    """
    with importing():
        from smc_mujoco.draw.page import files
        from smc_mujoco.mechanisms.named import as_plant
        from smc_mujoco.robustness.sensitivity import sensitivity
        from smc_mujoco.simulation.grid import case

    terminal = Terminal(json)
    over = _within(disturbance, bound)
    options.check_files(None, *files(figure))
    chosen = options.parsed_law(law)
    scenario = case(as_plant(plant), chosen, condition, duration, gains)
    result = sensitivity(scenario, over, metric, points, seed, threads, True, device)
    terminal.answer(result, full)
    terminal.finish(result.about())
    if figure:
        result.figure(figure)
        terminal.wrote(*files(figure))


def _within(disturbance: float | None, bounds: str | None) -> "Uncertainty | None":
    """Return the class of the options --disturbance and --bound: numbers and ranges; None if
    neither is given.
    """
    from smc_mujoco.robustness.uncertainty import Uncertainty

    fields: dict[str, Any] = {} if disturbance is None else {"disturbance": disturbance}
    names = {field.name for field in dataclasses.fields(Uncertainty)}
    for name, text in options.pairs(bounds, "--bound", "mass=0.7:1.3").items():
        try:
            values = list(map(real, text.split(":")))
        except ValueError:
            cure = "write a range as mass=0.7:1.3, a number as x0=0.2"
            raise ScenarioError(f"--bound {name}={text} cannot be read: {cure}") from None
        value = tuple(values) if len(values) > 1 else values[0]
        if name in names:
            fields[name] = value
        else:
            fields.setdefault("parameters", {})[name] = value
    return Uncertainty(**fields) if fields else None


def _cases(
    machine: "Machine",
    laws: "Sequence[str | Law]",
    condition: str,
    duration: float,
    gains: str,
) -> "list[Scenario]":
    """Return the scenario of each law under a condition."""
    from smc_mujoco.simulation.grid import case

    cases = []
    for law in laws:
        cases.append(case(machine, law, condition, duration, gains))
    return cases


def _attacked_cases(
    plant: str, law: list[str] | None, condition: str, duration: float, gains: str
) -> "list[list[Scenario]]":
    """Return the scenarios of each law to attack: one on a plant, one for each parameter set of a
    rig.
    """
    from smc_mujoco.control import gain_sets
    from smc_mujoco.identification import ensemble
    from smc_mujoco.identification.published_rig import rig as find_rig
    from smc_mujoco.identification.published_rig import rigs
    from smc_mujoco.mechanisms.named import as_plant

    if plant in rigs():
        rig = find_rig(plant)
        gain_set = "default" if gains == "tuned" else gains  # the laws of a rig have gains for it
        chosen = options.parsed_laws(law, of_rig=rig.laws) or rig.laws
        cases = []
        for attacked in chosen:
            cases.append(ensemble.runs(rig, [attacked], 1, gain_set, duration))
        return cases
    chosen = options.parsed_laws(law, gain_sets.LAWS)
    machine = as_plant(plant)
    cases = []
    for scenario in _cases(machine, chosen, condition, duration, gains):
        cases.append([scenario])
    return cases
