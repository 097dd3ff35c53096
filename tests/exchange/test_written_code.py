"""What the files of written laws say beside their code: other tests run that, in C, in FMUs and in JavaScript."""

import re
import zipfile

import pytest

import smc_mujoco as smc
from smc_mujoco.exchange.c import build
from smc_mujoco.exchange.c import export as c_export

FMUS = {  # name of a snapshot -> law, options of law_to_fmu
    "one joint": ("super_twisting", {"surface": "integral", "velocity": "levant", "u_max": 3.0, "joint": "slide"}),
    "with its model": ("pid", {"model": "nominal", "control_period": 2e-3}),
    "two joints": ("hybrid_sliding", {"joints": 2, "u_max": (3.0, 5.0)}),
}
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


@pytest.fixture(autouse=True)
def unmeasured(monkeypatch):
    """Without the size of a law's code, which depends on the compiler."""
    monkeypatch.setattr(c_export, "_measured", lambda code: "not measured")


def recorded(text: str) -> str:
    """Return a text without the version and without the lines of smc_law.h."""
    header = build.HEADER.read_text(encoding="utf-8").strip()
    return text.replace(smc.__version__, "VERSION").replace(header, "HEADER")


@pytest.mark.parametrize("name", FMUS)
def test_what_the_files_of_an_fmu_say_is_as_recorded(name, tmp_path, snapshot):
    """The comments of their code; of one FMU, also its XML files and the names of all."""
    law, given = FMUS[name]
    with zipfile.ZipFile(smc.exchange.law_to_fmu(law, tmp_path / "a.fmu", binary=False, **given)) as archive:
        texts = {one: recorded(archive.read(one).decode()) for one in archive.namelist()}
    written = [text for one, text in texts.items() if one.endswith(("controller.c", "controller.h", "or.c", "ce.c"))]
    said = [each for text in written for each in COMMENT.findall(text)]
    assert "\n".join(said) == snapshot
    if name == "one joint":
        description = re.sub(r"\{[0-9a-f-]{36}\}", "{TOKEN}", texts["modelDescription.xml"])
        assert "\n".join([*texts, description, texts["sources/buildDescription.xml"]]) == snapshot


@pytest.mark.parametrize(
    ("law", "numbers", "joints"),
    [("super_twisting", "float", None), ("observer_free_q15", "q15", None), ("passivity_based", "double", 3)],
)
def test_a_law_in_c_is_as_recorded(law, numbers, joints, snapshot):
    """The whole of one law; of others what is said before their code, without what their docstrings say."""
    text = recorded(smc.exchange.law_to_c(law, numbers, joints))
    text = re.sub(r"( \*\n \* [^\n]*\n).*?(?= \* gains )", r"\1", text, count=1, flags=re.DOTALL)
    assert (text if numbers == "float" else text.partition(";\n\n")[0]) == snapshot
