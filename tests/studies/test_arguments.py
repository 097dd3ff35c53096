"""What the calls of studies refuse before anything is run."""

import pytest

import smc_mujoco as smc
from smc_mujoco.studies import scene

pytestmark = pytest.mark.quick

RUN = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.5)


OTHER = smc.Scenario(plant="van_der_pol", law=smc.law("classical"))
SCENES = [
    {"title": ""},
    {"title": 3},
    {"conditions": {}},
    {"conditions": [RUN]},
    {"conditions": {"nominal": {}}},
    {"conditions": {"nominal": {"a": 3}}},
    {"conditions": {"": {"a": RUN}}},
    {"conditions": {"nominal": {"": RUN}}},
    {"conditions": {"nominal": {"a": RUN, "b": OTHER}}},
    {"conditions": {"nominal": {"a": RUN, "A": RUN}}},
    {"conditions": {"x": {"a": RUN}, "X": {"a": RUN}}},
    {"film": "noise"},
    {"figure": "figures"},
    {"answers": ("itaee",)},
    {"camera": (1.0,)},
]
REFUSED = {
    smc.leaderboard: [{"metrics": "itae"}, {"metrics": []}, {"metrics": ["itaee"]}],
    smc.study: [
        {"scenarios": [3]},
        {"scenarios": []},
        {"scenarios": "duffing"},
    ],
    smc.compare: [
        {"metrics": ["itaee"]},
        {"laws": "clasical"},
        {"plants": "dufing"},
        {"conditions": "nois"},
    ],
    smc.which: [
        {"needs": "fats"},
        {"needs": "accurate, robst"},
        {"needs": "two-gains", "laws": "pid"},
    ],
    smc.worst_case: [
        {"scenario": "duffing"},
        {"scenario": []},
        {"scenario": [RUN, OTHER]},
        {"within": 2.0},
        {"metric": "rms"},
        {"metric": "spread_bound"},
    ],
    smc.Scene: SCENES,
    smc.Table.read: [{"path": "none.parquet"}],
    scene.find: [{"name": "scenes/none.py"}, {"name": "vdp_nois"}],
}
GIVEN = {
    smc.leaderboard: {"table": None},
    smc.study: {"scenarios": [RUN], "out": "study"},
    smc.which: {"plant": "duffing"},
    smc.compare: {"laws": "classical", "plants": "duffing", "conditions": "nominal"},
    smc.worst_case: {"scenario": RUN},
    smc.Scene: {"title": "Two", "conditions": {"nominal": {"a": RUN}}},
}


@pytest.mark.parametrize("call", REFUSED, ids=lambda call: call.__name__)
def test_what_cannot_be_is_refused(call, monkeypatch, tmp_path, refused):
    monkeypatch.chdir(tmp_path)
    for change in REFUSED[call]:
        arguments = GIVEN.get(call, {}) | change
        refused(lambda arguments=arguments: call(**arguments))
    assert not [*tmp_path.iterdir()]
