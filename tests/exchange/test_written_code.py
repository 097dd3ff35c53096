"""The texts that laws are written as: C, the files of an FMU, JavaScript; other tests run what they compute."""

import re
import zipfile

import pytest

import smc_mujoco as smc
from smc_mujoco.control.estimator import catalogue as estimators
from smc_mujoco.control.law import catalogue as laws
from smc_mujoco.exchange.c import build
from smc_mujoco.exchange.c import export as c_export
from smc_mujoco.exchange.c.javascript import to_js

FMUS = {  # name of a snapshot -> law, options of export_fmu
    "one joint": ("super_twisting", {"surface": "integral", "velocity": "levant", "u_max": 3.0, "joint": "slide"}),
    "with its model": ("pid", {"model": "nominal", "control_period": 2e-3}),
    "two joints": ("hybrid_sliding", {"joints": 2, "u_max": (3.0, 5.0)}),
}


@pytest.fixture(autouse=True)
def unmeasured(monkeypatch):
    """Without the size of a law's code, which depends on the compiler."""
    monkeypatch.setattr(c_export, "_measured", lambda code: "not measured")


def recorded(text: str) -> str:
    """Return a text without the version and without the lines of smc_law.h."""
    header = build.HEADER.read_text(encoding="utf-8").strip()
    return text.replace(smc.__version__, "VERSION").replace(header, "HEADER")


@pytest.mark.parametrize("name", FMUS)
def test_the_files_of_an_fmu_are_as_recorded(name, tmp_path, snapshot):
    """All but those that every FMU has, as they are."""
    law, given = FMUS[name]
    with zipfile.ZipFile(smc.export_fmu(law, tmp_path / "a.fmu", binary=False, **given)) as archive:
        texts = {one: archive.read(one).decode() for one in archive.namelist()}
    assert list(texts) == snapshot(name="files")
    for one, text in texts.items():
        if not one.endswith(("fmu.c", "fmu.h", "law.h", "Types.h", "Functions.h")):
            assert recorded(re.sub(r"\{[0-9a-f-]{36}\}", "{TOKEN}", text)) == snapshot(name=one)


@pytest.mark.parametrize(
    ("law", "numbers", "joints"),
    [("super_twisting", "float", None), ("observer_free_q15", "q15", None), ("passivity_based", "double", 3)],
)
def test_a_law_in_c_is_as_recorded(law, numbers, joints, snapshot):
    assert recorded(smc.law_to_c(law, numbers, joints)) == snapshot


@pytest.mark.parametrize("component", [laws()["super_twisting"](), estimators()["kalman"]()], ids=lambda one: one.name)
def test_a_component_in_javascript_is_as_recorded(component, snapshot):
    assert to_js(component) == snapshot
