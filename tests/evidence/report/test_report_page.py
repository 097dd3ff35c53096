"""The report's page, made from findings that are written here, without any run."""

import dataclasses
import html
import inspect
import math
import re
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.margins import Margin
from smc_mujoco.analysis.region_of_attraction import Basin
from smc_mujoco.draw import region, style
from smc_mujoco.evidence.accuracy.accuracy import AccuracyTable
from smc_mujoco.evidence.accuracy.scaling import Accuracy, Scaling
from smc_mujoco.evidence.audit.verdict import Claim
from smc_mujoco.evidence.report import answer, charts, page, rigs, words
from smc_mujoco.evidence.report.about import About, Gains
from smc_mujoco.evidence.report.families import Lead
from smc_mujoco.evidence.report.films import Scene
from smc_mujoco.evidence.report.flight import Flight
from smc_mujoco.evidence.report.oscillation import Oscillation
from smc_mujoco.evidence.report.plan import Plan
from smc_mujoco.evidence.report.scores import Score
from smc_mujoco.evidence.report.stages import Field, Findings, Front
from smc_mujoco.evidence.rigs.rig import Fall
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.studies.worst_case import WorstCase

NEVER = math.inf
NONE = math.nan
PLANTS = "duffing", "van_der_pol", "no_plant", "pendulum_network"
LAWS = "observer_free", "classical", "super_twisting"
CONDITIONS = "nominal", "noise"
SIZES = {
    "settling_time": 2.0,
    "overshoot": 30.0,
    "itae": 0.4,
    "ultimate_bound": 1e-3,
    "steady_error": 7e-4,
}
SIZES |= {"max_u": 5.0, "tv_rate": 900.0}


def scores():
    """Other laws lead under other conditions; one never settles, one is level, one has runs that
    fail.
    """
    for i, plant in enumerate(PLANTS[:2]):
        for j, condition in enumerate(CONDITIONS):
            for k, (metric, size) in enumerate(SIZES.items()):
                best = LAWS[(i * j + k) % 3]
                for m, law in enumerate(LAWS):
                    median = size * (
                        1.0 + 0.3 * i + 0.7 * j + 1.9 * (m + 1) * (law != best) * 2.5**k
                    )
                    if (metric, law, i) == ("settling_time", "super_twisting", 1):
                        median = NEVER
                    if i == 0:
                        width = 0.1 * median if m else 0.0
                    else:
                        width = NONE
                    wins = law == best and (i, j) != (1, 1)
                    level = (i, j, m) == (1, 1, 1)
                    yield Score(
                        plant=plant,
                        condition=condition,
                        law=law,
                        metric=metric,
                        median=median,
                        low=median - width,
                        high=median + width,
                        best=law == best or level,
                        beaten=law != best and not level,
                        wins=wins,
                        lead="3.2 times less (2.9 to 3.5)" * wins,
                        seeds=6,
                        failed=(i + m) % 3 // 2,
                        runs=6 - j,
                        sample=f"{6 - j} starts",
                        floor={"ultimate_bound": 1e-4, "max_u": 6e-3}.get(metric, 0.0),
                        by_step=(median, 1.25 * median) if (i, j, k, m) == (0, 0, 2, 2) else None,
                    )


class Place(NamedTuple):
    """A law's line in a board: in how many of its blocks it loses and wins, its mean rank and runs
    that fail.
    """

    law: str
    losses: int = 0
    wins: int = 0
    mean: float = 1.0
    failed: int = 0
    median: float = 1.0
    metric: str = "itae"
    plant: str = "duffing"


def boards_of(places, of):
    """Return boards with these lines and so many blocks, of which a law loses the first ones."""
    boards = []
    for plant, metric in dict.fromkeys((place.plant, place.metric) for place in places):
        lines = [place for place in places if (place.plant, place.metric) == (plant, metric)]
        entries = []
        for p in lines:
            entries.append(
                SimpleNamespace(
                    law=p.law,
                    failed=p.failed,
                    rank=SimpleNamespace(mean=p.mean),
                    interval=SimpleNamespace(median=p.median),
                )
            )
        blocks = []
        for k in range(of):
            blocks.append(
                SimpleNamespace(best=[p.law for p in lines if k >= p.losses], level=False)
            )
        wins = {p.law: ["a condition"] * p.wins for p in lines}
        group = {"plant": plant}
        boards.append(
            SimpleNamespace(
                group=group, metric=metric, entries=entries, blocks=blocks, wins=wins.get
            )
        )
    return boards


def boards():
    places = []
    for i, plant in enumerate(PLANTS[:2]):
        for k, metric in enumerate(("settles", *words.MAIN_METRICS)):
            for m, law in enumerate(LAWS):
                wins, losses = ((2, 0), (0, 1), (1, 2))[(i * k + m) % 3]
                if metric == "settles":
                    median = (0.6, 1.0, 0.95)[m]
                else:
                    median = (m + 1) * (i + 1) * 0.31 * 10.0 ** (k - 3)
                places.append(
                    Place(law, losses, wins, 1.25 + m * 0.5, m // 2, median, metric, plant)
                )
    return boards_of(places, 2)


def claims():
    checks = {
        "duffing: settling time, s": {"value": 2.5, "relation": "<", "limit": 4.0, "holds": True},
        "largest step, over lambda": {
            "value": 1.25,
            "relation": "<=",
            "limit": 1.0,
            "holds": False,
        },
    }
    fields = {"measured": "runs with eps > 0", "holds_if": "steps of eps s^2 <= lambda"}
    yield Claim(
        id="3",
        text="observer_free settles",
        where="p. 4",
        **fields,
        verdict="partly supported",
        numbers={"tuned": checks},
        beside={"tuned": {"TV rate of classical": 12.5}},
        verdicts={"tuned": "partly supported"},
        flips=False,
        note="A note.",
        how="by eq. 3",
        read="abstract",
    )
    some = {what: {**its, "limit": 9.0, "holds": True} for what, its in checks.items()}
    yield Claim(
        id="18",
        text="it is calm",
        where="sec. 2",
        **fields,
        verdict="supported",
        numbers={"study": some, "tuned": checks},
        beside={"study": {}, "tuned": {}},
        verdicts={"study": "supported", "tuned": "refuted"},
        flips=True,
        over="some",
    )


PERIODS = (4e-3, 2e-3, 1e-3)


def scaling(errors, order, theory, interval=0.25, why=""):
    used = tuple(h for h, error in zip(PERIODS, errors, strict=True) if 0.0 < error < NEVER)
    ends = {"low": order - interval, "high": order + interval}
    return Scaling(errors=(errors,), used=used, order=order, **ends, theory=theory, why=why)


def accuracies():
    for condition in ("constant", "coulomb"):
        for m, law in enumerate(LAWS):
            if m:
                errors = tuple(3e-3 * (h / 4e-3) ** m for h in PERIODS)
            else:
                errors = (NEVER, 2e-4, 0.0)
            yield Accuracy(
                plant="duffing",
                condition=condition,
                law=law,
                gains="shipped",
                unit="m",
                periods=PERIODS,
                e=scaling(errors, NONE if not m else m + 0.1, m - 1 if m else None),
                s=scaling(
                    errors,
                    m + 0.5 * (condition == "coulomb"),
                    m if m else None,
                    why="levels off" * m,
                ),
                runs=6,
                failed=2 * (not m),
                floor=1e-9,
            )


def margins():
    for kind, size in (("delay", 0.012), ("mass", 3.0)):
        for i, plant in enumerate(PLANTS[:2]):
            for m, law in enumerate(LAWS):
                value = (NONE, size * (i + 1), 8.0 * size)[(i + m) % 3]
                theory = (None, 0.8 * size, NEVER)[m]
                yield Margin(
                    plant=plant,
                    law=law,
                    kind=kind,
                    value=value,
                    unit="s" if kind == "delay" else "1",
                    resolution=0.01 * size,
                    searched=8.0 * size,
                    theory=theory,
                )


def worst_cases():
    for m, law in enumerate(LAWS):
        scenario = smc.Scenario(plant="duffing", law=law)
        yield WorstCase(
            value=(0.2, 0.05, NEVER)[m],
            median=(0.02, 0.03, 0.01)[m],
            unit="m",
            scenario=scenario,
            found_by="steps",
            tried=40,
            nominal=scenario,
            within=smc.Uncertainty(disturbance=2.0),
            metric="rms_error",
            outside="",
            seed=0,
        )


def fields():
    for plant in PLANTS:
        x = np.linspace(-2.0, 2.0, 5)
        v = np.linspace(-3.0, 3.0, 9)
        s = v[:, None] + 1.5 * x
        yield Field(plant=plant, x=x, v=v, vdot=s * (0.5 - x**2), s=s)


def basins():
    for m, law in enumerate(LAWS[:2]):
        outcome = np.array([[1, 0, -1], [1, 1, m], [1, -1, 0], [-1, 1, 1]], np.int8)
        after = np.where(outcome == 1, [[2.5], [2.5], [5.0], [10.0]], 20.0)
        yield Basin(
            plant="duffing",
            law=law,
            x=np.linspace(-1, 1, 3),
            v=np.linspace(-2, 2, 4),
            outcome=outcome,
            decided_at=after,
            unit="m",
            duration=20.0,
        )


def fronts():
    for i, plant in enumerate(PLANTS[:2]):
        for m, law in enumerate(LAWS):
            tracking = tuple(0.01 * (1 + i + m) * 7.0**k for k in range(4))
            variation = tuple(90.0 / (1 + m) / 9.0**k for k in range(4))
            chosen = tracking[1], variation[1]
            yield Front(plant=plant, law=law, tracking=tracking, variation=variation, chosen=chosen)


def oscillations():
    for i, plant in enumerate(PLANTS[:2]):
        for m, law in enumerate(LAWS):
            predicted, seen = ((NONE, NONE), (0.02, 0.025), (0.04, NONE))[m]
            yield Oscillation(
                plant=plant,
                law=law,
                amplitude=predicted,
                frequency=11.0 + m,
                measured_amplitude=seen,
                measured_frequency=10.0 + i,
                third_harmonic=(NONE, 0.04, 0.3)[m],
                uncertainty=(NONE, 0.08, 2.0)[m],
                marked=(i, m) == (1, 1),
            )


def leads():
    """In one cell a family is surely first, in another it may not be; others have none."""
    yield Lead(PLANTS[0], CONDITIONS[0], "rivals", "switching", 1.5, 1.2, 1.9, ("adrc", "mpc"))
    yield Lead(PLANTS[1], CONDITIONS[0], "switching", "smoothed", 2.0, 0.8, 9.0, ("terminal",))


def machines():
    """The QUBE-Servo, on which one law wins in one metric, several in another and none in a third."""
    twin = smc.rig("qube_servo")
    winners = {
        "itae": ["relay"] * 4,
        "tv_rate": ["relay", None, "regulator", "relay"],
        "ultimate_bound": [None] * 4,
    }
    boards = []
    for k, (metric, won) in enumerate(winners.items()):
        medians = []
        for j in range(4):
            medians.append(
                {law.name: 0.03 * 10.0**k * (m + 1 + 0.1 * j) for m, law in enumerate(twin.laws)}
            )
        blocks = []
        for one, its in zip(won, medians, strict=True):
            blocks.append(SimpleNamespace(winner=one, medians=its, sample="6 starts"))
        boards.append(
            SimpleNamespace(
                metric=metric, blocks=blocks, winner=won[0] if len(set(won)) == 1 else None
            )
        )
    yield rigs.Machine(rig=twin, boards=tuple(boards))


def repeated():
    t = np.linspace(0.0, 1.0, 5)
    columns = {"theta": np.sin(t), "alpha": t**2}
    fits = {
        "the twin’s": {"theta": 94.06, "alpha": 88.0},
        "quanser": {"theta": Fall(8.44), "alpha": Fall(8.44)},
    }
    yield rigs.Repeated(
        rig=smc.rig("qube_servo"),
        name="a.npz",
        fits=fits,
        t=t,
        measured=columns,
        twin={name: 1.01 * values for name, values in columns.items()},
    )
    yield rigs.Repeated(rig=smc.rig("emps"), name="b <csv>", why="it is too short")


def flown():
    """Three laws in two conditions: one is unbeaten in both, one has runs that fail."""
    medians = {
        "geometric": (0.002, 0.2),
        "quaternion_sliding": (0.001, 0.1),
        "cascaded_pid": (0.01, NEVER),
    }
    blocks = []
    for i, name in enumerate(("nominal", "payload of 19 %")):
        blocks.append(
            SimpleNamespace(
                condition=name,
                best=("quaternion_sliding", "geometric")[: 2 - i],
                runs=6,
                sample="6 seeds",
                medians={law: values[i] for law, values in medians.items()},
                lacking={"cascaded_pid": 3 * i},
            )
        )
    worst = {}
    for block in blocks:
        for law, value in block.medians.items():
            worst[(block.condition, law)] = 3.0 * value
    board = SimpleNamespace(blocks=blocks, entries=[SimpleNamespace(law=law) for law in medians])
    return Flight(
        board=board,
        worst=worst | {("nominal", "geometric"): 0.0021},
        medians=b"<svg/>",
        gains="default",
    )


def scenes():
    for plant, film in (("duffing", b"film"), ("pendulum_network", None)):
        yield Scene(
            plant=plant,
            condition="nominal",
            laws=LAWS[:2],
            curves=b"<svg/>",
            film=film,
            seconds=2.0,
        )


def about():
    plan = Plan(
        quick=True,
        plants=PLANTS[:2],
        laws=LAWS,
        conditions=CONDITIONS,
        seeds=6,
        duration=3.0,
        kinds=("delay", "mass"),
        points=(3, 4),
        basins=("duffing",),
        relevant=0.05,
    )
    made = About(
        plan=plan,
        runs=144,
        failed=4,
        seeds=6,
        sources="gains of all laws: shipped",
        versions={"smc_mujoco": "1.2", "mujoco": "3.4"},
        spent={"grid": 12.4, "claims": 3.6},
        no_film="nothing renders here: install a renderer",
    )
    vars(made)["gains"] = [
        Gains("study", "duffing", "classical", "k 3, c 2", "by hand"),
        Gains("tuned", "duffing", "classical", "k 4", "shipped"),
    ]
    return made


@pytest.fixture(scope="module")
def findings():
    found = tuple(margins())
    made = (
        scores,
        leads,
        boards,
        claims,
        fields,
        fronts,
        oscillations,
        basins,
        machines,
        repeated,
        scenes,
    )
    return Findings(
        **{one.__name__: tuple(one()) for one in made},
        medians=b"<svg></svg>",
        worst=tuple(worst_cases()),
        flight=flown(),
        margins=found,
        by_set={"tuned": found[:6], "study": found[:4]},
        accuracies=AccuracyTable(accuracies()),
        about=about(),
    )


SVG = re.compile(r"<svg.*?</svg>", re.S)


def said(text):
    """Return what a page says, a line for each row, with the target of each link."""
    text = re.sub(r"<style>.*?</style>", "", text, flags=re.S)
    text = re.sub(r"<script>.*?</script>", "", SVG.sub("", text), flags=re.S)
    text = re.sub(r'<div class="plot" role="img" aria-label="(.*?)">', r"chart: \1", text)
    text = re.sub(r'<a [^>]*?href="(.*?)".*?>(.*?)</a>', r"\2 [\1]", text, flags=re.S)
    text = re.sub(r'<video [^>]*?aria-label="(.*?)" src="(.*?)">', r"video: \1 (\2)", text)
    text = re.sub(r"<select.*?</select>", "", text, flags=re.S)
    text = re.sub(r"</t[dh]>", " | ", text)
    return re.sub(r"\n\s+", "\n", html.unescape(re.sub(r"<[^>]*?>", "", text)))


def test_a_page_says_its_findings(findings, snapshot):
    text, _, defined = map(said, page.page(findings).partition('<h3 id="definitions">'))
    for metric in metrics():
        assert (
            said(words.pretty(str(inspect.getdoc(metric.formula)).split("\n\n")[-1])) in defined
        ), metric.name
    assert (
        re.sub(r"the package’s \d+ laws", "the package’s laws", text) == snapshot
    )  # a new one needs no new record


def test_charts_have_the_colours_of_the_page_and_say_their_numbers_where_the_pointer_rests(
    findings,
):
    shown = {}
    for kind in ("delay", "mass"):
        shown[kind] = charts.embedded(charts.margins(findings.margins, kind), kind)
    hints = {kind: re.findall(r"<title>(.*?)</title>", svg) for kind, svg in shown.items()}
    for margin in findings.margins:
        if math.isnan(margin.value):
            value = "none"
        else:
            value = f"{'at least ' * (margin.value >= margin.searched)}{margin.value:.3g}"
        assert any(
            hint.startswith(f"{words.law(margin.law)}: {value}") for hint in hints[margin.kind]
        ), margin
    ids = [re.findall(r' id="(.*?)"', svg) for svg in shown.values()]
    assert set(ids[0]) & set(ids[1]) == set()
    for svg in shown.values():
        assert set(re.findall(r"(?:url\(|href=\")#([^\")]*)", svg)) <= set(
            re.findall(r' id="(.*?)"', svg)
        )
        assert "metadata" not in svg
        colours = set(re.findall(r"(?<!, )#[0-9a-f]{6}", svg))
        assert colours == set()  # each is the page's, or lighter by night
    maps = charts.embedded(charts.basins(findings.basins, [2.5, 5.0, 10.0]), "maps", maps=True)
    assert style.FAILED.lower() in maps, "the key's grey"
    assert all(f"{shade}: at rest" in maps for shade in region.SHADES)
    assert "--lift" not in maps


def cells(rows, metric="itae"):
    """Scores of cells: for each cell, law -> "wins", "level" or its median, where the best one is
    1.
    """
    for k, cell in enumerate(rows):
        for law, how in cell.items():
            median = how if isinstance(how, float) else 1.0
            yield Score(
                plant=PLANTS[k % 2],
                condition=CONDITIONS[k // 2 % 2],
                law=law,
                metric=metric,
                median=median,
                low=median,
                high=median,
                best=median == 1.0,
                beaten=median > 1.0,
                wins=how == "wins",
                lead="",
                seeds=6,
                failed=0,
                runs=6,
                sample="6 starts",
                floor=0.0,
            )


A, B, C, D = (*LAWS, "pid")
CASES = {  # what was found -> scores
    "one law unbeaten": cells([{A: "level", B: "level", C: 2.0}, {A: "level", C: "level", B: 3.0}]),
    "none unbeaten": cells([{A: "level", B: "level", C: 2.0}, {B: 2.0, A: 4.0, C: "level"}]),
    "three unbeaten": cells([dict.fromkeys((A, B, C), "level") | {D: 2.0}]),
    "four unbeaten": cells([dict.fromkeys((A, B, C, D), "level")]),
    "one wins": cells([{A: 2.0, B: "wins"}] * 2),
    "one wins on every plant": cells(
        [{A: 2.0, B: "wins"}] * 2 + [{A: "wins", B: 5.0}, {A: 3.0, B: "wins"}]
    ),
    "four win": cells(
        [
            {A: "wins", B: 2.0, C: 2.0, D: 2.0},
            {A: 4.0, B: "wins", C: 2.0, D: 2.0},
            {A: 8.0, B: 2.0, C: "wins", D: 2.0},
            {A: 16.0, B: 2.0, C: 2.0, D: "wins"},
        ]
    ),
}


def test_the_answer_is_counted_from_the_scores(findings, snapshot):
    lines = []
    for name, some in CASES.items():
        few = dataclasses.replace(findings, scores=tuple(some), claims=())
        lines += [
            f"{name}:",
            answer.first(few, ["itae"]),
            answer.sure(few, ["itae"]),
            answer.verdict(few, ["itae"]),
        ]
    assert "\n".join(lines) == snapshot
