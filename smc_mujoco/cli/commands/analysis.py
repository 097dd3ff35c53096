"""smc-mujoco tune, margins, worst, basin, chatter: one question about laws on a plant, by many runs."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_ctrl_c
from smc_mujoco.common.text import counted

if TYPE_CHECKING:
    from smc_mujoco.analysis.gains_for import Design
    from smc_mujoco.control.law import Law
    from smc_mujoco.simulation.scenario import Scenario

QUICK_MARGINS = {  # defaults of `margins --quick`
    "plants": ["inverted_pendulum", "duffing"],
    "laws": ["observer_free", "classical", "adaptive", "super_twisting"],
    "kinds": ["delay", "disturbance"],
}


@errors_as_sentences()
def tune(
    plant: options.PlantName,
    law: options.LawText,
    objective: Annotated[
        str, typer.Option(help="balanced: error, and variation of u; tracking: only error.")
    ] = "balanced",
    budget: Annotated[
        int | None, typer.Option(min=1, help="Sets of gains to try at most; default: several starts of the search.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search and of the noise.")] = 0,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Also write gains, history and provenance to a file.")
    ] = None,
    front: Annotated[Path | None, options.picture("error against variation")] = None,
    chattering: Annotated[
        float | None, typer.Option(help="Largest predicted amplitude of s, in its unit, in the first condition.")
    ] = None,
    condition: options.Conditions = None,
    x0: options.X0 = None,
    spread: options.Spread = None,
    threads: options.Threads = None,
) -> None:
    """Find a law's gains on a plant by a rule that is the same for every law.

    Every law has the same bound on u, the same objective and the same search, from several starts. Each gain is
    searched over the same number of decades about a scale that follows from its unit and the plant. The objective is
    error times time, plus variation of u, summed over seven conditions in runs of 5 s: nominal, noise, delay, a sine
    and a constant disturbance, 30 % more and 30 % less mass. The same seed gives the same gains.

    Example: smc-mujoco tune duffing observer_free --out duffing.json
    """
    with delay_ctrl_c():
        from smc_mujoco.analysis.tuning import search
        from smc_mujoco.common.files import with_ending, writable

    writable(out, front)
    path, terminal = out and with_ending(out, ".json"), Terminal()
    tries, tested, start = budget or search.BUDGET, options.conditions(condition) or None, options.starts(x0, spread)
    tuned = search.tune(options.plant(plant), law, tries, seed, objective, threads, True, tested, start, chattering)
    terminal.print(tuned)
    terminal.note(f"{terminal.seconds:.0f} s", "dim")
    if path:
        terminal.wrote(tuned.save(path))
    if front:
        from smc_mujoco.draw.page import files
        from smc_mujoco.draw.pareto import pareto

        pareto([tuned], front)
        terminal.wrote(*files(front))


@errors_as_sentences()
def margins(
    plants: options.Plants = None,
    law: options.Laws = None,
    kinds: Annotated[
        str | None,
        typer.Option(
            help="Any of delay, disturbance, friction, mass, noise, jitter, missed, as a,b; default the first 5."
        ),
    ] = None,
    gains: options.Gains = "tuned",
    quick: Annotated[
        bool, typer.Option("--quick", help="Shorter runs, coarser results; default 2 plants, 4 laws, 2 kinds.")
    ] = False,
    condition: options.Condition = "nominal",
    x0: options.X0 = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE.csv", help="Also write the table to a file.")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
) -> None:
    """Find how much a law tolerates: the largest level at which the error still ends below 5 % of its start.

    A constant disturbance and dry friction are in N or N m, mass is a multiple of the nominal one, noise is the
    standard deviation of the position (that of the velocity is 5/s times as large), and the delay of the command is in
    s. The column theory has the limit that the loop has when it is linearised at rest, for example the delay at which
    rest becomes unstable; not every law can be linearised. A law may tolerate more, with a small steady oscillation.
    The module smc_mujoco.analysis.margins describes the search and its limits.

    Example: smc-mujoco margins duffing --law observer_free,classical --kinds delay
    """
    with delay_ctrl_c():
        from smc_mujoco.analysis.margins import KINDS, save, save_csv
        from smc_mujoco.analysis.margins import margins as search
        from smc_mujoco.cli import tables
        from smc_mujoco.common.files import with_ending
        from smc_mujoco.common.progress import bar
        from smc_mujoco.control import gain_sets
        from smc_mujoco.simulation.conditions import PLANTS

    json, terminal = options.json_file(json, out and with_ending(out, ".csv"))
    machines = [options.plant(text) for text in options.names(plants, QUICK_MARGINS["plants"] if quick else PLANTS)]
    chosen = options.laws(law, QUICK_MARGINS["laws"] if quick else gain_sets.LAWS)
    kind = options.names(kinds, QUICK_MARGINS["kinds"] if quick else KINDS)
    with bar("margins") as progress:
        start = options.starts(x0, None)
        results = search(machines, chosen, kind, gains, quick, threads, progress.reached, condition, start)
    for name in kind:
        terminal.print(tables.margins(name, [margin for margin in results if margin.kind == name]))
    words = f"{counted(len(results), 'margin')}, {options.gains_used(chosen, gains)}, {terminal.seconds:.0f} s"
    terminal.note(words, "dim", wrap=True)
    if out:
        terminal.wrote(save_csv(results, out))
    if json:
        terminal.wrote(save(results, json))


@errors_as_sentences()
def worst(
    plant: Annotated[
        str,
        typer.Argument(
            metavar="PLANT|RIG", autocompletion=options.PLANTS, help="A plant, FILE.xml:joint+joint, or a rig's sets."
        ),
    ],
    law: options.Laws = None,
    disturbance: Annotated[float, typer.Option(help="Bound on |d|, N or N m, on every driven joint.")] = 0.0,
    slope: Annotated[float | None, typer.Option(help="Bound on |d'|, per second; default: d may jump.")] = None,
    position_noise: Annotated[float, typer.Option(help="Bound on errors of measured positions, rad or m.")] = 0.0,
    velocity_noise: Annotated[float, typer.Option(help="Bound on errors of measured velocities, per second.")] = 0.0,
    hold: Annotated[float, typer.Option(help="How long each error of measurement lasts, s.")] = 0.05,
    delay: Annotated[str | None, typer.Option(metavar="LOW:HIGH", help="Input delay, s, as 0:0.01.")] = None,
    jitter: Annotated[float, typer.Option(help="Largest delay of a control sample, s.")] = 0.0,
    mass: Annotated[str | None, typer.Option(metavar="LOW:HIGH", help="Factor on the mass, as 0.7:1.3.")] = None,
    friction: Annotated[str | None, typer.Option(metavar="LOW:HIGH", help="Dry friction, N or N m, as 0:0.1.")] = None,
    friction_scale: Annotated[
        str | None, typer.Option(metavar="LOW:HIGH", help="Factor on the friction that there is, as 0.5:2.")
    ] = None,
    parameter: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=LOW:HIGH", help="Another parameter, as alpha=0.8:1.2. May be repeated."),
    ] = None,
    spread: Annotated[float, typer.Option(help="How far x0 may be off, as a share of it.")] = 0.0,
    metric: Annotated[str, typer.Option(help="The metric to make large, any of `smc.score`.")] = "rms_error",
    gains: options.Gains = "tuned",
    condition: options.Condition = "nominal",
    duration: Annotated[
        float, typer.Option(help="Duration of the runs, s; the error of the first quarter does not count.")
    ] = 8.0,
    budget: Annotated[int | None, typer.Option(min=1, help="Runs of a search; default: about 10 s a law.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    out: Annotated[Path | None, options.picture("the worst runs")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
) -> None:
    """Find the worst that can happen to laws within bounds that you give: an adversary instead of random seeds.

    You say only what is uncertain: a bound on the disturbance, ranges of mass, delay and friction. By default, it is
    what the plant declares, such as an arm's payload, or else a disturbance up to a sixth of what the weakest drive
    gives. Of a rig, such as qube_servo, the adversary also chooses one of its parameter sets.

    The search is the same for every law: constant forces, forces that switch with the sign of s, of e or of its rate,
    waves at the frequency of the loop, all corners of the ranges, and an evolution from the worst of these. There may
    be worse than what it finds.

    The column "worst found" has the error of the worst run, the column "median" that of as many random runs within the
    bounds. Laws are ordered by the worst. A line below the table says where the bounds go beyond the theorem of a law.
    The law of your file has its default gains: tune it first (`smc-mujoco tune`).

    Example: smc-mujoco worst duffing --law classical,super_twisting,observer_free --disturbance 2 --mass 0.7:1.3

    Example: smc-mujoco worst panda --law computed_torque_sliding --gains default --parameter payload=0:2
    """
    with delay_ctrl_c():
        from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty
        from smc_mujoco.common.files import write_json
        from smc_mujoco.draw.page import files
        from smc_mujoco.studies.worst_case import WorstCases, worst_case

    json, terminal = options.json_file(json, *files(out))
    ranges = {"delay": delay, "mass": mass, "friction": friction, "friction_scale": friction_scale}
    noise = {"position_noise": position_noise, "velocity_noise": velocity_noise, "jitter": jitter}
    bounds = {"disturbance": disturbance, "slope": slope, "x0": spread} | noise | _ranges(ranges, parameter or ())
    set_bounds: dict[str, Any] = {name: bound for name, bound in bounds.items() if bound}
    within = Uncertainty(hold=hold, **set_bounds) if set_bounds else None
    chosen, cases = _attacked_cases(plant, law, condition, duration, gains)
    results = WorstCases(worst_case(runs, metric, within, budget, seed, threads, progress=True) for runs in cases)
    terminal.print(results)
    terminal.note(f"{sum(case.tried for case in results)} runs, {options.gains_used(chosen, gains)}", "dim", wrap=True)
    if json:
        terminal.wrote(write_json(json, [case.about() for case in results]))
    if out:
        results.figure(out)
        terminal.wrote(*files(out))


def _ranges(ranges: Mapping[str, str | None], parameters: Sequence[str]) -> dict[str, Any]:
    """Return the fields of an Uncertainty from texts such as "0.7:1.3", and from those of --parameter."""
    pairs = [text.partition("=") for text in parameters]
    return {
        "parameters": {name: options.low_and_high(f"--parameter {name}", text) for name, _, text in pairs},
        **{name: options.low_and_high(f"--{name.replace('_', '-')}", text) for name, text in ranges.items() if text},
    }


def _attacked_cases(
    plant: str, law: list[str] | None, condition: str, duration: float, gains: str
) -> "tuple[list[str | Law], list[list[Scenario]]]":
    """Return the laws to attack, and the scenarios of each: one on a plant, one for each parameter set of a rig."""
    from smc_mujoco.common import annexes
    from smc_mujoco.control import gain_sets
    from smc_mujoco.simulation.grid import case

    rigs = annexes.module("smc_mujoco.evidence.rigs.rig", "a rig") if annexes.installed("evidence") else None
    if rigs and plant in rigs.rigs():
        rig, ensemble = rigs.rig(plant), annexes.module("smc_mujoco.evidence.rigs.ensemble", "a rig")
        gain_set = "default" if gains == "tuned" else gains  # the laws of a rig have gains for it
        chosen = options.laws(law, of_rig=rig.laws) or rig.laws
        cases = [ensemble.runs(rig, [attacked], 1, gain_set, duration) for attacked in chosen]
        return [runs[0].law for runs in cases], cases
    chosen = options.laws(law, gain_sets.LAWS)
    return chosen, [[case(options.plant(plant), attacked, condition, duration, gains)] for attacked in chosen]


@errors_as_sentences()
def basin(
    plant: options.PlantName,
    law: Annotated[
        str, typer.Option(autocompletion=options.LAWS, help=f"A law. {options.GAINS_HELP}")
    ] = "observer_free",
    points: Annotated[int, typer.Option(min=2, help="Number of positions, and of velocities.")] = 50,
    gains: options.Gains = "tuned",
    duration: Annotated[float, typer.Option(help="Duration of the longest runs, s.")] = 10.0,
    out: Annotated[Path | None, options.picture("the map")] = None,
    json: options.Json = None,
    condition: options.Condition = "nominal",
    threads: options.Threads = None,
) -> None:
    """Map a region of attraction: run a grid of initial positions and velocities, and show which come to rest at 0.

    Positions reach half a turn to either side; on a rail, twice as far as the plant's start. The largest velocity is
    three times the largest position, per second. All channels of a network have the same start. A run ends as soon as
    its outcome is decided, by the rule in smc_mujoco.analysis.region_of_attraction.

    Example: smc-mujoco basin inverted_pendulum --law classical --out classical.png
    """
    with delay_ctrl_c():
        from smc_mujoco.analysis.region_of_attraction import CONVERGES, DOES_NOT, UNDECIDED
        from smc_mujoco.analysis.region_of_attraction import basin as search
        from smc_mujoco.common.progress import bar
        from smc_mujoco.draw.page import files
        from smc_mujoco.draw.region import draw

    pictures = files(out)
    json, terminal = options.json_file(json, *pictures)
    chosen = options.law(law)
    with bar(f"{law} on {plant}") as progress:
        region = search(
            options.plant(plant), chosen, (points, points), gains=gains, duration=duration, threads=threads,
            report=progress.reached, condition=condition,
        )  # fmt: skip
    terminal.note(f"{region.law} on {region.plant}: {100 * region.share:.3g} % of the states converge")
    yes, no, undecided = (int((region.outcome == kind).sum()) for kind in (CONVERGES, DOES_NOT, UNDECIDED))
    counts = f"{yes} converge, {no} do not, {undecided} undecided after {duration:g} s"
    terminal.note(f"{counts}; {options.gains_used([chosen], gains)}, {terminal.seconds:.0f} s", "dim")
    if json:
        terminal.wrote(region.save(json))
    if pictures:
        draw([region], out)
        terminal.wrote(*pictures)


@errors_as_sentences()
def chatter(
    plant: options.PlantName,
    law: options.Laws = None,
    actuator: Annotated[
        str | None,
        typer.Option(metavar="PART:NUMBERS", help="What drives the joints, as lag:0.01, ratelimit:200 or dcmotor."),
    ] = None,
    condition: options.Condition = "nominal",
    gains: options.Gains = "tuned",
    channel: Annotated[int, typer.Option(min=0, help="The driven channel.")] = 0,
    amplitude: Annotated[
        float | None,
        typer.Option(min=1e-12, help="Take the largest gains whose predicted amplitude of s stays below this."),
    ] = None,
    frequency: Annotated[
        float | None,
        typer.Option(min=1e-3, help="Take the largest gains whose predicted frequency, Hz, stays below this."),
    ] = None,
    duration: Annotated[float, typer.Option(min=0.1, help="Duration of the runs that measure it, s.")] = 8.0,
    out: Annotated[Path | None, options.picture("Nyquist plots and runs")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
) -> None:
    """Predict how much laws chatter, by harmonic balance, and measure it in runs.

    If a law switches and the actuator lags, the loop oscillates without end. Frequency and amplitude follow from the
    law's describing function N and the response L of the linearised mechanism: N L = 1. The column "±" is how far
    the predicted amplitude or frequency may be off. There are two reasons: s has harmonics, and the cycle may be locked
    to the control samples, which shifts the instant at which the law switches. A star marks a run whose amplitude or
    frequency changes by more than 10 % with half the physics step. The column "third" is the third harmonic over the
    first.

    If the plant has several driven channels, the column "coupling" is how far this channel's command moves another
    channel, over how far it moves this one. The prediction is for a single channel. It fails if the coupling is not
    small, because the channels then oscillate together.

    With --amplitude or --frequency, the gains of each law are scaled in proportion until the prediction meets the
    bound. Then the constant disturbance that they tolerate is measured.

    Example: smc-mujoco chatter duffing --law classical,super_twisting --actuator lag:0.01 --out chatter
    """
    with delay_ctrl_c():
        from smc_mujoco.analysis.chattering import chattering, save, shared_assumptions
        from smc_mujoco.analysis.step_halving import step_halving
        from smc_mujoco.cli import tables
        from smc_mujoco.common.progress import bar
        from smc_mujoco.control import gain_sets
        from smc_mujoco.draw.page import files
        from smc_mujoco.metrics.limit_cycle import channel_cycle
        from smc_mujoco.simulation.grid import case
        from smc_mujoco.simulation.run import run

    pictures = files(out)
    json, terminal = options.json_file(json, *pictures)
    chosen = options.laws(law, gain_sets.LAWS)
    fields = {} if actuator is None else {"actuator": options.actuator(actuator)}
    cases = [case(options.plant(plant), law, condition, duration, gains, changes=fields) for law in chosen]
    designs = []
    if amplitude is not None or frequency is not None:
        cases, designs = _designed(cases, amplitude, frequency, channel, terminal)
    with bar("chattering") as progress:
        cycles = []
        for done, scenario in enumerate(cases):
            progress.reached(done, len(cases) + 1)
            cycles.append(chattering(scenario, channel))
        traces = run(cases, threads=threads)
        measured, changes = [channel_cycle(trace, channel) for trace in traces], step_halving(traces, channel, threads)
    terminal.print(tables.chattering(cases, channel, cycles, measured, changes))
    if designs:
        terminal.print(tables.designs(designs, cases[0].efforts[channel]))
    terminal.note("assumed: " + "; ".join(shared_assumptions(cycles)), wrap=True)
    terminal.note(f"{options.gains_used(chosen, gains)}, {terminal.seconds:.0f} s", "dim", wrap=True)
    if json:
        terminal.wrote(save(cases, cycles, measured, changes, json))
    if pictures:
        from smc_mujoco.draw.nyquist import nyquist

        nyquist(cases, out, channel, cycles, traces, changes=changes)
        terminal.wrote(*pictures)


def _designed(
    cases: "Sequence[Scenario]", amplitude: float | None, frequency: float | None, channel: int, terminal: Terminal
) -> "tuple[list[Scenario], list[Design]]":
    """Return the cases whose laws have gains for the bounds, with these gains, and the gains; name the other laws."""
    from smc_mujoco.analysis.gains_for import design

    designed, designs = [], []
    for scenario in cases:
        try:
            designs.append(design(scenario, amplitude, frequency, channel))
        except ScenarioError as error:
            terminal.note(f"{scenario.law.name} is left out: {error}", "yellow", wrap=True)
        else:
            designed.append(dataclasses.replace(scenario, law=designs[-1].law))
    if not designs:
        raise ScenarioError("no law has such gains: give a larger --amplitude or --frequency")
    return designed, designs
