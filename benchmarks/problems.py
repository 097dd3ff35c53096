"""The benchmark's targets, controls and rank correlations, from runs of the catalogue.

    python benchmarks/problems.py measure laws visible.json
    python benchmarks/problems.py measure controls controls.json --seed random --instances 24
    python benchmarks/problems.py measure controls seen.json --instances 15
    python benchmarks/problems.py freeze visible.json controls.json seen.json  # writes the targets
    into the rules
    python benchmarks/problems.py hold                     # do both controls hold everywhere?
    python benchmarks/problems.py repeat FOLDER [duffing/noise@1 ...]  # are the targets the rules'?
    python benchmarks/problems.py measure laws drawn.json --seed random
    python benchmarks/problems.py agree visible.json drawn.json  # rank correlations of the boards
    python benchmarks/problems.py enter results            # every general law

`measure laws` runs every general law with its best shipped gains on every problem of the paper's
plants, `measure controls` the controls on all problems; ten minutes of processor time each. With
`--version 2` and `3`, `measure` and `freeze` are for the rules of flight, and of carts with
friction, where levels come from no law.
`measure` and `enter` go on where they were stopped.
"""

import argparse
import json
import math
import secrets
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import controls
import numpy as np
from scipy.stats import kendalltau, rankdata, spearmanr

from smc_mujoco.control import gain_sets
from smc_mujoco.control.law import Law
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.problems import enter, suite
from smc_mujoco.problems import problem as problems
from smc_mujoco.simulation.run import stream

INSTANCES = 7  # of each problem, for medians of laws
MEASURES = "failed", "accuracy", "itae", "settling", "calm"
CONTROLLED = 24  # of each problem, for the controls
ATTACKED = 2  # instances against an adversary
# of a target over the oracle's worst on visible instances: levels are written with three digits
SEEN = 1.01
# got shipped gains after the freeze of version 1
LATER = {"pendulum_network/mpc", "inverted_pendulum_network/mpc"}
MARGIN = 1.25  # of a target over the oracle's worst; 2 where no catalogue sets the levels
NEAR = 0.1  # of the start: no target is easier, and a problem in which u = 0 ends there is left out
MARK = "# From here on: `python benchmarks/problems.py freeze`, nothing by hand.\n"
BOARDS = {"forces": "accuracy", "sensors": "accuracy", "speed": "settling", "calm": "calm"}
Runs = dict[str, dict[str, np.ndarray]]  # problem -> law -> (instances, MEASURES)


def cells(*versions: int) -> list[str]:
    """List the problems of some versions; without any, of all."""
    return [
        f"{cell}@{v}"
        for v in versions or map(int, problems.versions())
        for cell in problems.cells(v)
    ]


def laws_of(kind: str, one: problems.Problem) -> dict[str, Law]:
    """Return the laws to run on a problem, by name."""
    if kind == "controls":
        oracles = {}
        for w, share in controls.oracles(one):
            oracles[f"oracle {w:g} {share:g}"] = controls.oracle_of(one.plant, w, share)
        return {"zero": controls.zero(one.plant)} | oracles
    plant = find_plant(one.plant)
    return {
        law: gain_sets.law_with_gains(plant, law)
        for law in gain_sets.general()
        if gain_sets.in_set(plant, law, "tuned")
    }


def measure(kind: str, out: Path, seed: int, instances: int, names: Sequence[str]) -> None:
    """Run laws or controls on some problems, and write their measures."""
    done: dict
    if out.exists():
        done = json.loads(out.read_text())
    else:
        done = {"seed": seed, "runs": {}}
    seed = done["seed"]
    runs = done["runs"]
    out.write_text(json.dumps(done))
    for name in (name for name in names if name not in runs):
        plant, condition, version = str(name).replace("@", "/").split("/")
        # as problem(), also where left out
        text = (problems.RULES / f"{version}.toml").read_text(encoding="utf-8")
        chosen = problems.Problem(
            id=name, plant=plant, condition=condition, version=int(version), rules=text
        )
        attacked = "/worst" in name
        laws = laws_of(kind, chosen)
        count = min(instances, ATTACKED) if attacked else instances
        if not laws or (attacked and kind == "laws"):
            continue
        scenarios = []
        for law in laws.values():
            for s in controls.scenarios(chosen, law, range(count), seed):
                scenarios.append(s)
        values_of_run = [[math.nan]] * len(scenarios)
        for i, trace in stream(scenarios):
            values = chosen.measures(trace)
            values_of_run[i] = [values[measure] for measure in MEASURES]
        runs[name] = {law: values_of_run[i * count : (i + 1) * count] for i, law in enumerate(laws)}
        out.write_text(json.dumps(done))
        print(name, file=sys.stderr, flush=True)


def read(path: Path) -> Runs:
    """Return what `measure` wrote."""
    runs = json.loads(path.read_text())["runs"]
    return {
        name: {law: np.array(values) for law, values in laws.items()} for name, laws in runs.items()
    }


def levels(
    laws: Mapping[str, np.ndarray], measure: str, worst: float, rules: Mapping[str, Any]
) -> list[float]:
    """Return the levels of a measure in a problem, the hardest first, none harder than what the
    oracle reaches.
    """
    if laws:
        medians = [np.median(values[:, MEASURES.index(measure)]) for values in laws.values()]
        chosen = np.quantile(medians, rules["quantiles"], method="higher")
        # laws of which half of the runs fail
        chosen = np.minimum(chosen, max(filter(math.isfinite, medians)))
    else:
        easiest = rules["easiest"][measure] * (worst if measure != "accuracy" else 1.0)
        chosen = np.geomspace(
            worst, max(worst, min(easiest, rules.get("latest", {}).get(measure, math.inf))), 5
        )
    chosen = np.maximum(chosen, worst)
    return chosen.tolist()


def targets(
    name: str,
    laws: Mapping[str, np.ndarray],
    runs: Mapping[str, np.ndarray],
    seen: Mapping[str, np.ndarray],
) -> dict[str, Any] | None:
    """Return the targets of a problem and the oracle's bandwidth; None where a control forbids it.

    `runs` are those of the controls on drawn instances, which get a margin, `seen` on the visible
    ones.
    """
    rules = problems.rules(int(name.partition("@")[2]))
    best = None
    margin = MARGIN if laws else 2.0
    for label, oracle in runs.items():
        if not label.startswith("oracle"):
            continue
        setting = [float(word) for word in label.split()[1:]]
        columns = {m: MEASURES.index(m) for m in problems.MEASURES}
        worst = {}
        for m, i in columns.items():
            worst[m] = max(margin * oracle[:, i].max(), SEEN * seen[label][:, i].max())
        worst["accuracy"] = max(worst["accuracy"], 0.0 if laws else rules["hardest"])
        if not all(map(math.isfinite, worst.values())):
            continue
        levels_by_measure = {m: levels(laws, m, worst[m], rules) for m in problems.MEASURES}
        ease = sum(math.log(level) for measure in levels_by_measure.values() for level in measure)
        if best is None or ease < best[0]:
            best = ease, setting, levels_by_measure, worst
    if best is None:
        return None
    _, setting, levels_by_measure, worst = best
    best_of_nothing = float(runs["zero"][:, MEASURES.index("accuracy")].min())
    if worst["accuracy"] > (bound := min(best_of_nothing / 2.0, NEAR)) or best_of_nothing < NEAR:
        return None
    levels_by_measure["accuracy"] = [min(level, bound) for level in levels_by_measure["accuracy"]]
    return levels_by_measure | {"oracle": setting}


def repeat(folder: Path, names: Sequence[str], version: int) -> bool:
    """Run all that the targets of a version's problems were frozen from.

    Return whether they are those of its rules.
    """
    rules = problems.rules(version)
    folder.mkdir(parents=True, exist_ok=True)
    measure("laws", folder / "laws.json", 0, INSTANCES, names)
    measure(
        "controls", folder / "controls.json", int(rules["frozen"]["number"], 16), CONTROLLED, names
    )
    measure("controls", folder / "seen.json", 0, rules["visible"], names)
    visible, of_controls, seen = (
        read(folder / f"{kind}.json") for kind in ("laws", "controls", "seen")
    )
    differ = 0
    for name in names:
        cell = name.partition("@")[0]
        laws = {}
        for law, runs in visible.get(name, {}).items():
            if f"{cell.partition('/')[0]}/{law}" not in LATER:
                laws[law] = runs
        levels_by_measure = targets(name, laws, of_controls[name], seen[name])
        stored = rules["targets"].get(cell)
        if levels_by_measure is not None:
            levels_by_measure |= {
                m: [float(f"{level:.3g}") for level in levels_by_measure[m]]
                for m in problems.MEASURES
            }
        differ += levels_by_measure != stored
        print(
            name,
            "the same"
            if levels_by_measure == stored
            else f"differs: {levels_by_measure}, and in the rules {stored}",
            flush=True,
        )
    return not differ


def margins(
    one: problems.Problem, instances: str | Sequence[int], seed: int
) -> tuple[float, float, int]:
    """Return by what factors both controls hold on instances of a problem, above 1 if they do, and
    their failures.

    The oracle's is the least, over runs and measures, of the hardest level over the measure; that
    of u = 0 is its least accuracy over the easiest level. A failure is a target that the oracle
    misses or u = 0 reaches.
    """
    oracle = math.inf
    zero = math.inf
    failures = 0
    for control, law in controls.frozen(one).items():
        for _, trace in stream(controls.scenarios(one, law, instances, seed)):
            values = one.measures(trace)
            reached = []
            for key, t in values.items():
                if key.rpartition("_")[2].isdigit():
                    reached.append(math.isfinite(t))
            if control == "zero":
                failures += sum(reached)
            else:
                failures += reached.count(False)
            if control == "zero":
                zero = min(zero, values["accuracy"] / one.targets["accuracy"][-1])
            else:
                oracle = min(oracle, *(levels[0] / values[m] for m, levels in one.targets.items()))
    return oracle, zero, failures


def hold(seed: int, instances: int | None) -> bool:
    """Print the margins of both controls on every problem of every suite, and return whether both
    hold on all.
    """
    names = sorted({name for suite_name in suite.suites() for name in suite.suite(suite_name)})
    table: dict[str, dict[str, str]] = {}
    margin_rows = []
    failing = []
    for name in names:
        chosen = problems.problem(name)
        if instances:
            count = range(min(instances, ATTACKED) if "/worst" in name else instances)
        else:
            count = "visible"
        oracle, zero, failures = margins(chosen, count, seed)
        margin_rows.append((oracle, zero, name))
        if failures:
            failing += [f"{name}: {failures} targets"]
        else:
            failing += []
        table.setdefault(chosen.plant, {})[chosen.condition] = f"{oracle:.2f}, {zero:.3g}"
        print(name, f"{oracle:.3f}", f"{zero:.3g}", failures, sep="\t", file=sys.stderr, flush=True)
    conditions = list(dict.fromkeys(name.replace("@", "/").split("/")[1] for name in names))
    print("", *conditions, sep=" | ")
    for plant, cells_of in table.items():
        print(plant, *(cells_of.get(condition, "–") for condition in conditions), sep=" | ")
    print(
        f"{len(names)} problems, {len(failing)} where a control does not hold: "
        f"{'; '.join(failing) or 'none'}"
    )
    print(
        "least of the oracle:",
        *min(margin_rows)[::2],
        "; least of u = 0:",
        *min(margin_rows, key=lambda row: row[1])[1:],
    )
    return not failing


def freeze(visible: Runs, of_controls: Runs, seen: Runs, seed: int, version: int) -> None:
    """Write targets and what is left out below the mark in the rules."""
    path = problems.RULES / f"{version}.toml"
    lines = ["[targets]"]
    left_out = []
    for name in cells(version):
        if (
            levels_by_measure := targets(name, visible.get(name, {}), of_controls[name], seen[name])
        ) is None:
            left_out.append(name.partition("@")[0])
            continue
        texts = []
        for m in problems.MEASURES:
            texts.append(f"{m} = [{', '.join(f'{level:.3g}' for level in levels_by_measure[m])}]")
        texts.append(f"oracle = {levels_by_measure['oracle']}")
        lines.append(f'"{name.partition("@")[0]}" = {{ {", ".join(texts)} }}')
    write_suites(left_out, version)
    text = path.read_text().partition(MARK)[0] + MARK
    head = (
        f'[frozen]\nnumber = "{seed:064x}"  # of the controls\nleft_out = '
        f"{json.dumps(left_out)}\n\n"
    )
    path.write_text(text + head + "\n".join(lines) + "\n")
    print(f"{len(lines) - 1} problems with targets; left out: {', '.join(left_out) or 'none'}")


def write_suites(left_out: Sequence[str], version: int) -> None:
    """Write the lists of a version's suites, without the problems that are left out."""
    names = [name for name in cells(version) if name.partition("@")[0] not in left_out]
    lists = {
        "smc-30@1": (
            "Those that the pattern of version 1 chooses, 3 of 5, see suite.py.",
            suite.pattern(1, 3),
        ),
        "smc-50@1": ("All problems of the pattern's plants and conditions.", suite.pattern(1, 5)),
        "smc-arm@1": (
            "The arm of two links.",
            [name for name in names if name.startswith("double_pendulum")],
        ),
        "smc-carts@1": (
            "A joint without an actuator.",
            [n for n in names if n.startswith(("cart_pole", "furuta"))],
        ),
        "smc-worst@1": (
            "The paper's plants against an adversary.",
            [name for name in names if "/worst" in name],
        ),
        "smc-flight@2": ("A quadrotor.", names),
        "smc-carts@3": ("A joint without an actuator, and friction.", names),
    }
    for name, (words, chosen) in lists.items():
        if not name.endswith(f"@{version}"):
            continue
        text = "".join(f"{chosen_name}\n" for chosen_name in chosen if chosen_name in names)
        (suite.SUITES / f"{name}.txt").write_text(f"# {words}\n{text}")


def board(runs: Runs, names: Sequence[str], question: str) -> np.ndarray:
    """Return the mean rank of each law's median over the problems of a board; equal medians share
    their rank.
    """
    measure = MEASURES.index(BOARDS[question])
    informing = [name for name in names if question in suite.boards(name)]
    everywhere = [law for law in runs[names[0]] if all(law in runs[name] for name in runs)]
    ranks = []
    for name in informing:
        ranks.append(rankdata([np.median(runs[name][law][:, measure]) for law in everywhere]))
    return np.mean(ranks, axis=0)


def agree(visible: Runs, drawn: Runs) -> None:
    """Print the rank correlations of boards, visible with drawn ones, and those of smc-30 with the
    problems left out.
    """
    chosen = suite.suite("smc-30@1")
    all_names = suite.suite("smc-50@1")
    outside = [name for name in all_names if name not in chosen]
    print("board | visible with drawn, tau (rho) | with the problems left out, tau (rho)")
    for question in BOARDS:
        mine = board(visible, chosen, question)
        cells = []
        for ranks in (
            board(drawn, chosen, question),
            board(visible, outside, question),
        ):
            cells.append((kendalltau(mine, ranks)[0], spearmanr(mine, ranks)[0]))
        print(question, *(f"{tau:.3f} ({rho:.3f})" for tau, rho in cells), sep=" | ")


def enter_all(out: Path) -> None:
    """Enter every general law in smc-30@1, of those that are not in the folder of results yet."""
    for law in gain_sets.general():
        if not (out / "smc-30@1" / law / enter.RESULT).exists():
            print(enter.enter(law, out=out), file=sys.stderr, flush=True)


def parser() -> argparse.ArgumentParser:
    """Return the command line."""
    argument_parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = argument_parser.add_subparsers(dest="command", required=True)
    measured = commands.add_parser("measure")
    measured.add_argument("kind", choices=("laws", "controls"))
    measured.add_argument("out", type=Path)
    measured.add_argument("--seed", default="0", help='a number, or "random"; 0: visible instances')
    measured.add_argument("--instances", type=int, default=INSTANCES)
    for name, files in (
        ("freeze", ("visible", "controls", "seen")),
        ("agree", ("visible", "drawn")),
    ):
        command = commands.add_parser(name)
        for file in files:
            command.add_argument(file, type=Path)
    for command in (measured, commands.choices["freeze"]):
        command.add_argument("--version", type=int, default=1, help="of the rules; default 1")
    held = commands.add_parser("hold")
    held.add_argument("--seed", default="0", help='a number, or "random"; 0: visible instances')
    held.add_argument("--instances", type=int, help="of each problem; default: all visible ones")
    repeated = commands.add_parser("repeat")
    repeated.add_argument("folder", type=Path)
    repeated.add_argument("problems", nargs="*")
    commands.add_parser("enter").add_argument("results", type=Path)
    return argument_parser


if __name__ == "__main__":
    options = parser().parse_args()
    seed = getattr(options, "seed", "0")
    seed = secrets.randbits(256) if seed == "random" else int(seed)
    print(f"seed {seed}", file=sys.stderr)
    if options.command == "measure":
        measure(options.kind, options.out, seed, options.instances, cells(options.version))
    elif options.command == "hold":
        sys.exit(not hold(seed, options.instances))
    elif options.command == "repeat":
        named = options.problems or cells()
        same = []
        for version in map(int, problems.versions()):
            if own_names := [name for name in named if name in cells(version)]:
                same.append(repeat(options.folder / str(version), own_names, version))
        sys.exit(not all(same))
    elif options.command == "freeze":
        controlled = read(options.controls)
        seen = read(options.seen)
        seed = json.loads(options.controls.read_text())["seed"]
        freeze(read(options.visible), controlled, seen, seed, options.version)
    elif options.command == "enter":
        enter_all(options.results)
    else:
        agree(read(options.visible), read(options.drawn))
