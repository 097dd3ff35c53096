"""What the annex's commands hand on, print and leave, with the work itself replaced by typed
results.
"""

import contextlib
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.arguments import reported

import smc_mujoco as smc
from smc_mujoco.cli import main
from smc_mujoco.common.progress import Bar
from smc_mujoco.evidence.audit.verdict import Claim, Claims
from smc_mujoco.identification.identify import Identified
from smc_mujoco.identification.rig import Fall

CHECKS = {
    "duffing: settling time, s": {
        "value": 2.5,
        "relation": "<",
        "limit": 4.0,
        "holds": True,
    },
    "largest step of u in the period, over that of the classical law (TV rate)": {
        "value": 1.25,
        "relation": "<=",
        "limit": 1.0,
        "holds": False,
    },
}
EMPS = smc.rig("emps")
CLAIMS = Claims(
    [
        Claim(
            id="3",
            text="it settles",
            where="p. 4",
            measured="runs",
            holds_if="steps <= 1",
            verdict="refuted",
            numbers={"study": CHECKS, "tuned": CHECKS},
            beside={"study": {}, "tuned": {"TV rate": 12.5}},
            verdicts={"study": "supported", "tuned": "refuted"},
            flips=True,
            note="A note.",
            how="by eq. 3",
            read="abstract",
            over="some",
            instead="It rests.",
            shown_by="smc-mujoco claims 3",
        ),
        Claim(
            id="4",
            text="it is calm",
            where="p. 5",
            measured="runs",
            holds_if="calm",
            verdict="not testable",
            numbers={"study": {}, "tuned": {}},
            beside={"study": {}, "tuned": {}},
            verdicts={"study": "not testable", "tuned": "not testable"},
            flips=False,
            note="Nothing says how.",
        ),
        Claim(
            id="5",
            text="of one set",
            where="p. 6",
            measured="runs",
            holds_if="calm",
            verdict="not testable",
            numbers={"study": {}},
            beside={"study": {}},
            verdicts={"study": "not testable"},
            flips=False,
        ),
    ]
)


def identified(count):
    """Quantities of the axis: one at the end of its range, one that may be 0, one just not; records
    that fit badly.
    """
    rig = EMPS.with_values(
        {
            "mass": 120.5,
            "viscous": 0.0,
            "coulomb": 2.0,
            "offset": 6.0,
        },
        "identified",
    )
    correlations = np.eye(4)
    correlations[0, 2] = correlations[2, 0] = -0.999
    t = np.arange(3.0)
    columns = {"x": t, "u": t**2}
    fits = ({"x": 99.04, "u": 81.0}, {"x": 90.0, "u": 60.0}, {"x": Fall(8.44), "u": Fall(8.44)})
    return Identified(
        rig=rig,
        before=EMPS,
        values={name: rig.values[name] for name in rig.free},
        errors={
            "mass": 0.0213,
            "viscous": 1.0,
            "coulomb": 2.0,
            "offset": 7.0,
        },
        correlations=correlations,
        fits=fits[:count],
        fits_before=({"x": 99.0, "u": 81.5}, *fits[1:count]),
        predictions=((columns, columns, t),) * count,
        evaluations=41,
        independent=100.0,
        data=(columns,) * count,
    )


class Notes(list):
    """What the stubs were called with."""

    def stub(self, monkeypatch, name, gives=None):
        def noted(*given, **options):
            words = [
                *map(reported, given),
                *(f"{key}={reported(option)}" for key, option in options.items()),
            ]
            self.append(f"{name.rpartition('.')[2]}({', '.join(words)})")
            if callable(gives):
                return gives(*given, **options)
            return gives

        monkeypatch.setattr(f"smc_mujoco.{name}", noted)

    @contextlib.contextmanager
    def bar(self, what, whole=None, shown=True, counted=False):
        self.append(f"bar of {what}, whole {whole}{', counted' * counted}")
        drawn = Bar()
        drawn.reached = lambda done, whole: self.append(f"  reached {done} of {whole}")
        drawn.advance = lambda work: self.append(f"  advance {work}")
        yield drawn


def audited(about, ids, sets, quick, threads, report):
    report(1, 2)
    save = lambda path: path  # noqa: E731
    claims = Claims(claim for claim in CLAIMS if claim.id in (ids or "34"))
    return SimpleNamespace(claims=claims, paper=about, save=save)


def repeated(name):
    """A twin whose replays are texts."""
    twin = SimpleNamespace(
        name=name,
        label=f"the rig {name}",
        units={"x": "m"},
        start=2.0,
        set=repeated,
    )
    twin.columns = SimpleNamespace(time="t")
    twin.fit = lambda _: {"x": 99.04, "u": 1.25}
    twin.fits = lambda _: [{"x": Fall(8.44), "u": -20.0}]
    twin.predictions = lambda _: [(f"{name} predicted", "measured", "times")]
    twin.replay = lambda record, start, duration: f"{name} from {start} for {duration}"
    twin.measured = lambda record, start, duration: f"measured from {start} for {duration}"
    return twin


STUBS = {  # of each command: the functions replaced, and what they give
    "claims": {
        "evidence.audit.audit.audit": audited,
        "evidence.audit.paper.new": [Path("mine/paper.toml"), Path("mine/claims.py")],
        "evidence.audit.paper.papers": {
            "small": SimpleNamespace(authors="A. B", title="C", contents="3 claims")
        },
        "evidence.audit.evidence.read_sealed": {
            "paper": {"authors": "A. B and others", "title": "C" * 90},
            "counts": {"supported": 2},
        },
    },
    "identify": {
        "identification.identify.identify": lambda of, many, *_, **__: identified(len(many)),
        "identification.published_rig.residual_figure": [Path("run.svg")],
    },
    "rig": {
        "identification.published_rig.rig": repeated,
        "identification.records.load_record": lambda file, names: {"t": np.array([3.0, 4.0])},
        "identification.residual_figure.residual_figure": [Path("run.svg")],
        "simulation.run.run": lambda runs: runs,
        "cli.run_scene.filmed": [Path("film.mp4")],
    },
}
AXIS = ("mass 120.500 ± 0.021 kg", "offset 6.000 ± 7 N", "(correlation -0.999)")
AXIS += ("viscous is at the end of its range", "offset may as well be 0")
GIVEN = {  # line -> exit code, what is handed on, printed and left, spaces aside
    "claims 3 --gains study,tuned --quick --threads 2": (
        0,
        [
            "audit(a Paper gaber, ['3'], ['study', 'tuned'], True, 2, report=",
            "reached 1 of 2",
            "whose the paper's, abstract: by eq. 3",
            "verdict ○ refuted, flips",
            "study gains: supported",
            "✓ duffing: settling time, s 2.5 < 4",
            "✗ largest step of u",
            "1.25 <= 1",
            "TV rate 12.5",
            "instead It rests. (smc-mujoco claims 3)",
            "○ 1 refuted.",
            "Of the paper's 0 supported sentences 0 hold under every set of gains",
            "quick: coarser grids",
        ],
    ),
    "claims --gains study": (
        0,
        ["refuted 3 it settles", "next smc-mujoco claims 3", "○ 1 refuted"],
    ),
    "claims --full --evidence e.json": (
        0,
        [
            "audit(a Paper gaber, None, None, False, None",
            "id study tuned",
            "3 ● ○ it settles ○ refuted, flips with the gains; the paper's, abstract",
            "= 1.25 (<= 1 asked)",
            "4 – – it is calm – not testable; the paper's Nothing says how.",
            "wrote e.json",
        ],
    ),
    "claims 5 --quick": (
        0,
        ["audit(a Paper gaber, ['5'], None, True, None", "fewer sets of gains"],
    ),
    "claims 4 --json c.json --quick": (
        0,
        [
            "audit(a Paper gaber, ['4'], None, True, None",
            '"verdict": "not testable"',
            '"flips": false',
            '"verdicts": {"study": "not testable", "tuned": "not testable"}',
        ],
    ),
    "claims --papers": (0, ["papers()", "small A. B: C (3 claims)"]),
    "claims --new mine --check e.json": (
        0,
        [
            "new(Path(mine))",
            "read_sealed(Path(e.json))",
            "wrote mine/claims.py",
            "the seal is whole: A. B and others, C",
            ": 2 supported",
        ],
    ),
    (
        "identify emps a.csv b.csv c.csv --columns x=position --for mass,offset --starts 2 "
        "--seed 3 --corrected --held-out d.csv"
    ): (
        0,
        [
            "identify('emps', [Path(a.csv), Path(b.csv), Path(c.csv)], ['mass', 'offset'], "
            "held_out=Path(d.csv), columns={x: 'position'}, condition=None, corrected=True, starts=2, seed=3",
            *AXIS,
            "fits falls at 8.4 s (whole logs, worst column)",
            "the fit is poor",
            "run.svg report run/report.html",
        ],
    ),
    "identify duffing a.csv b.csv --json found.json --figure fit": (
        0,
        [
            "identify('duffing', [Path(a.csv), Path(b.csv)], None, held_out=None, columns=None, "
            "condition=None, corrected=False, starts=1",
            "{twin: {x: 99.04, u: 81.0}}, {x: 'm', u: 'V'}, Path(fit))",
            *AXIS,
            "fits 60.0 %",
            "the fit is poor",
            "run.svg report run/report.html",
            "wrote found.json",
            '"mass": {"value": 120.5, "error": 0.0213, "unit": "kg"}',
            '"fits_before": [{"x": 99.0,',
        ],
    ),
    "rig emps run.csv --columns x=position": (
        0,
        [
            "rig('emps') load_record(Path(run.csv), {x: 'position'})",
            "x u",
            "twin 99.0 1.2",
        ],
    ),
    "rig emps run.csv --sets driver,quanser --start 1.5 --duration 6 --figure run --film film.mp4": (
        0,
        [
            "{twin: 'emps predicted', driver: 'driver predicted', quanser: 'quanser predicted'}",
            "u: -20.0}}, {x: 'm'}",
            "run(['emps from 1.5 for 6.0', 'driver from 1.5 for 6.0', 'quanser from 1.5 for 6.0'])",
            "filmed(['measured from 1.5 for 6.0', 'emps from 1.5 for 6.0',",
            "'emps: run, from 4.5 s of the record'",
            "['measured', 'twin', 'driver', 'quanser']",
            "driver falls at 8.4 s -20.0",
            "wrote run.svg wrote film.mp4",
        ],
    ),
    "rig emps run.csv --film film.mp4": (
        0,
        ["run(['emps from None for None'])", "from 5 s of the record'"],
    ),
}


@pytest.fixture
def called(tmp_path, monkeypatch, capsys):
    """Run a line with the work replaced: exit code, what was handed on, what was printed and left,
    the error.
    """

    def run(line):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "run.svg").write_text("<svg/>")  # what a figure's stub says it has written
        monkeypatch.setenv("COLUMNS", "80")
        monkeypatch.setattr("warnings.showwarning", None)
        notes, (command, *_) = Notes(), line.split()
        monkeypatch.setattr("smc_mujoco.common.progress.bar", notes.bar)
        for name, gives in STUBS.get(command, {}).items():
            notes.stub(monkeypatch, name, gives)
        with pytest.raises(SystemExit) as ended:
            main.main(line.split())
        said = capsys.readouterr()
        files = []
        for path in tmp_path.glob("*.json"):
            files.append(json.dumps(json.loads(path.read_text())))
        return (
            ended.value.code or 0,
            notes,
            f"{said.out}\n{said.err if notes else ''}{' '.join(files)}",
            said.err,
        )

    return run


@pytest.mark.quick
@pytest.mark.parametrize("line", GIVEN, ids=str)
def test_a_command_hands_on_what_it_is_given_and_prints_what_comes_back(line, called, tmp_path):
    code, notes, out, _ = called(line)
    text = " ".join("\n".join([*notes, out]).replace(str(tmp_path), ".").split())
    missing = []
    for part in GIVEN[line][1]:
        if part not in text:
            missing.append(part)
    assert (code, missing) == (GIVEN[line][0], []), text
