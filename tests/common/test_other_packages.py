"""Entries of other packages: found by name, imported when asked for, and no harm if something is
wrong with them.
"""

import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common import registry
from smc_mujoco.control import estimator, gain_sets, law, surface
from smc_mujoco.mechanisms import plant
from smc_mujoco.simulation import run_key
from smc_mujoco.studies import scene

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "my_smc_package"
CACHED = (
    registry._points,
    law.law_catalogue,
    law.all_laws,
    law.joint_law_catalogue,
    surface.surface_catalogue,
    estimator.estimator_catalogue,
    plant.plant_catalogue,
    scene.scenes,
)

LAW = """
import smc_mujoco as smc
@smc.law_function(gains={"k": 2.0})
def NAME(y, gains, memory):
    return -gains.k * y.e, y.e
"""
PLANT = """
import dataclasses
import smc_mujoco as smc
NAME = dataclasses.replace(smc.plant("duffing"), name="NAME")
"""

Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """A function that installs a package: its name, entry points by group, and the code of its
    modules.
    """

    def forget() -> None:
        for function in CACHED:
            function.cache_clear()
        registry._warned.clear()

    def add(package: str, points: dict[str, dict[str, str]], **modules: str) -> Path:
        folder = tmp_path / package
        about = folder / f"{package}-1.0.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = []
        for group, names in points.items():
            lines.append(
                f"[smc_mujoco.{group}]\n" + "".join(f"{k} = {v}\n" for k, v in names.items())
            )
        (about / "entry_points.txt").write_text("\n".join(lines))
        for name, code in modules.items():
            (folder / f"{name}.py").write_text(code)
        monkeypatch.syspath_prepend(str(folder))
        forget()
        return folder

    yield add
    monkeypatch.undo()
    forget()


def said(call: Callable[[], object]) -> list[str]:
    """What a call warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    return [str(warning.message) for warning in caught]


# found, and imported when asked for


@pytest.mark.quick
def test_an_entry_runs_like_one_of_the_library(install, tmp_path):
    install(
        "theirs",
        {
            "laws": {"their_law": "theirs_laws:their_law"},
            "plants": {"their_plant": "theirs_plants:their_plant"},
        },
        theirs_laws=LAW.replace("NAME", "their_law"),
        theirs_plants=PLANT.replace("NAME", "their_plant"),
    )
    assert "their_law" in smc.laws()
    assert "their_law" in smc.laws("their_plant")
    assert smc.law("their_law", k=3.0).gains["k"] == 3.0
    (run,) = smc.grid(
        ["their_plant"],
        ["their_law"],
        ["nominal"],
        seeds=1,
        duration=0.02,
        gains="default",
    )
    trace = smc.run(run)
    same = smc.run(
        smc.Scenario(
            plant="duffing",
            law="their_law",
            x0=run.x0,
            duration=0.02,
            u_max=run.u_max,
        )
    )
    assert_array_equal(trace.x, same.x)
    assert smc.load(trace.save(tmp_path / "a.npz")).scenario == run


def test_a_package_is_imported_by_the_use_of_its_entries_alone(install):
    install(
        "lazy",
        {"laws": {"lazy_law": "lazy_laws:lazy_law"}},
        lazy_laws=LAW.replace("NAME", "lazy_law"),
    )
    smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.01))
    assert "lazy_law" in law.all_laws()
    assert "lazy_laws" not in sys.modules
    smc.law("lazy_law")
    assert "lazy_laws" in sys.modules


def test_an_entry_made_after_its_package_listed_the_catalogue_is_found(install):
    """As a script does that compares its own law with all others."""
    install(
        "forward",
        {"laws": {"forward_law": "forward_laws:forward_law"}},
        forward_laws="import smc_mujoco as smc\nbefore = smc.laws()\n"
        + LAW.replace("NAME", "forward_law"),
    )
    with pytest.warns(smc.errors.PackageWarning, match="'forward_law'"):
        import forward_laws  # pyright: ignore[reportMissingImports]
    assert "forward_law" not in forward_laws.before
    assert smc.law("forward_law").name == "forward_law"
    assert "forward_law" in smc.laws()


def test_every_catalogue_takes_entries(install):
    install(
        "many",
        {
            "joint_laws": {"many_joint": "many_all:many_joint"},
            "surfaces": {"many_surface": "many_all:many_surface"},
            "estimators": {"many_estimator": "many_all:many_estimator"},
            "scenes": {"many_scene": "many_scene"},
        },
        many_all="""
import smc_mujoco as smc
@smc.law_function(joint=True, gains={"k": 2.0})
def many_joint(y, gains, memory):
    return -gains.k * y.e, y.e
@smc.design.surface_function(gains={"k": 2.0})
def many_surface(y, gains, memory):
    return y.de + gains.k * y.e, -gains.k * y.de
@smc.estimator_function(gains={"k": 2.0})
def many_estimator(y, gains, memory):
    return gains.k * y.v
""",
        many_scene='"""Is it listed?"""\nraise RuntimeError("a scene is not run to be listed")',
    )
    assert "many_joint" in smc.laws(kind="joint")
    assert "many_surface" in smc.laws(kind="surface")
    assert "many_estimator" in smc.laws(kind="estimator")
    assert scene.question(scene.find("many_scene")) == "Is it listed?"
    assert "many_scene" not in sys.modules


@pytest.mark.filterwarnings("ignore:no set of gains")
def test_a_package_brings_the_gains_of_its_law(install):
    units = "from smc_mujoco.control.units import FORCE_PER_POSITION, Gain"
    tuned_law = LAW.replace("NAME", "tuned_law").replace("2.0", "Gain(2.0, FORCE_PER_POSITION)")
    folder = install(
        "tuned", {"laws": {"tuned_law": "tuned_laws:tuned_law"}}, tuned_laws=units + tuned_law
    )
    with pytest.raises(
        smc.ScenarioError,
        match=r"no gains in set 'tuned' for tuned_law on duffing: .*smc-mujoco tune",
    ):
        gain_sets.law_with_gains("duffing", "tuned_law")
    budget = 8
    brief = Objective(conditions=("nominal",), duration=0.2)
    tuned = smc.tune("duffing", "tuned_law", budget, objective=brief, searches=2)
    tuned.save(folder / "tuned_gains" / "tuned" / "duffing-tuned_law.json")
    assert [
        gain_sets.law_with_gains("duffing", "tuned_law", seed=seed).gains
        for seed in range(len(tuned.sets))
    ] == [dict(zip(tuned.bounds, gain_set.gains, strict=True)) for gain_set in tuned.sets]
    shipped = gain_sets.tuned("duffing", "tuned_law").search
    assert shipped.rule == tuned.rule
    assert shipped.searches == 2
    assert shipped.evaluations == tuned.evaluations
    assert shipped.spread == pytest.approx(tuned.spread, abs=1e-5)


def test_a_plant_of_a_package_may_be_a_model_s_file(install, tmp_path):
    """It has the name of its entry, which nobody else may give to a model."""
    xml = (EXAMPLE / "my_smc_package/models/sprung_cart.xml").read_text()
    code = 'gantry = smc.plant_from(PATH, channels=["slide"], name="gantry")\n'
    default = 'trolley = smc.plant_from(PATH.with_name("trolley.xml"), channels=["slide"])\n'
    folder = install(
        "cranes",
        {"plants": {"gantry": "cranes_plants:gantry", "trolley": "cranes_plants:trolley"}},
        cranes_plants="import smc_mujoco as smc\nfrom pathlib import Path\n"
        f"PATH = Path(__file__).with_name('gantry.xml')\n{code}{default}",
    )
    for name in ("gantry", "trolley"):
        (folder / f"{name}.xml").write_text(xml)
    assert smc.plant("gantry").name == "gantry"
    assert smc.plant("trolley").name == "trolley"
    trace = smc.run(smc.Scenario(plant="gantry", law="classical", duration=0.02))
    assert smc.load(trace.save(tmp_path / "a.npz")).scenario.plant.name == "gantry"
    with pytest.raises(smc.ScenarioError, match="name is 'gantry': give one that is none"):
        smc.plant_from(folder / "gantry.xml", channels=["slide"], name="gantry")


def test_a_run_s_key_has_the_mjcf_that_a_plant_reads(install):
    folder = install(
        "files",
        {"plants": {"file_plant": "file_plants:file_plant"}},
        file_plants=PLANT.replace("NAME", "file_plant")
        + """
import mujoco
from pathlib import Path
def build(n):
    return mujoco.MjSpec.from_file(str(Path(__file__).parent / "file_plant.xml"))
file_plant = dataclasses.replace(file_plant, build=build)
""",
    )
    xml = (EXAMPLE / "my_smc_package/models/sprung_cart.xml").read_text()
    keys = []
    for stiffness in ("8", "9"):
        (folder / "file_plant.xml").write_text(
            xml.replace('stiffness="8"', f'stiffness="{stiffness}"')
        )
        keys += [
            run_key.run_key(smc.Scenario(plant="file_plant", law="none", duration=0.1))
            for _ in range(2)
        ]
    assert keys[0] == keys[1] != keys[2] == keys[3]


# what is wrong is one sentence, and the rest works

BROKEN = {
    "missing": ("bad_law:missing", "AttributeError"),
    "raises": ("bad_raises:raises", "ZeroDivisionError: division by zero"),
    "exits": ("bad_exits:exits", "SystemExit: 3"),
    "shy": ("bad_shy:shy", "Shy, whose message cannot be read"),
    "nowhere": ("bad_nowhere:nowhere", "ModuleNotFoundError: No module named 'bad_nowhere'"),
    "number": ("bad_law:number", "it is 3: give a function decorated with smc.law_function"),
    "other": ("bad_law:renamed", "its own name is 'renamed': give the entry point the same name"),
    "flat": ("bad_law:flat", "give a function decorated with smc.law_function"),
}


@pytest.fixture
def broken(install):
    install(
        "bad",
        {"laws": {name: value for name, (value, _) in BROKEN.items()} | {"good": "bad_good:good"}},
        bad_law=LAW.replace("NAME", "renamed")
        + "number = 3\nflat = smc.design.surface_function(lambda y, gains, memory: (y.e, 0.0))",
        bad_raises="1 / 0",
        bad_shy="class Shy(Exception):\n    def __str__(self):\n        raise self\nraise Shy",
        bad_exits="raise SystemExit(3)",
        bad_good=LAW.replace("NAME", "good"),
    )


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_entry_is_one_sentence_where_it_is_asked_for(broken, name):
    with pytest.raises(smc.ScenarioError) as raised:
        smc.law(name)
    sentence = str(raised.value)
    assert sentence.startswith(f"package 'bad': its law {name!r} ({BROKEN[name][0]})")
    assert BROKEN[name][1] in sentence
    assert "\n" not in sentence


def test_a_broken_entry_is_a_warning_where_all_are_listed_and_said_once(broken):
    first = said(smc.laws)
    assert len(first) == len(BROKEN)
    for name in BROKEN:
        assert f"its law {name!r}" in "".join(first)
    assert said(smc.laws) == []
    assert "good" in smc.laws()
    assert not BROKEN.keys() & {*smc.laws()}
    assert smc.run(smc.Scenario(plant="duffing", law="good", duration=0.01)).failure is None


def test_a_name_of_the_library_is_not_taken_over(install):
    install(
        "grab",
        {"laws": {"classical": "grab_laws:classical"}},
        grab_laws=LAW.replace("NAME", "classical"),
    )
    (sentence,) = said(lambda: smc.law("classical"))
    assert sentence.startswith(
        "package 'grab': its law 'classical' (grab_laws:classical) has the name of an entry of the "
        "library"
    )
    assert smc.law("classical").function is law.law_catalogue().own["classical"].function
    assert "grab_laws" not in sys.modules


def test_one_name_in_two_packages_is_one_sentence(install):
    for package in ("first", "second"):
        install(
            package,
            {"laws": {"twin": f"{package}_laws:twin"}},
            **{f"{package}_laws": LAW.replace("NAME", "twin")},
        )
    cure = "law 'twin' is in the packages 'first' and 'second': uninstall one of them, or rename it"
    with pytest.raises(smc.ScenarioError) as raised:
        smc.law("twin")
    assert str(raised.value) == cure
    assert said(smc.laws) == [cure]
    assert "twin" not in smc.laws()


def test_a_user_s_law_may_not_have_the_name_of_another_package_s(install):
    install(
        "theirs",
        {"laws": {"named_law": "named_laws:named_law"}},
        named_laws=LAW.replace("NAME", "named_law"),
    )

    @smc.law_function(gains={"k": 1.0})
    def named_law(y, gains, memory):
        return -gains.k * y.e, y.e

    with pytest.raises(
        smc.ScenarioError, match="the name of a law of package 'theirs': rename its function"
    ):
        smc.grid(["duffing"], [named_law], ["nominal"], seeds=1)


# the template


USE = """
import pickle, sys
import smc_mujoco as smc
assert "my_smc_package" not in sys.modules
if __name__ == "__main__":
    laws = ["arctan_switching", "classical"]
    runs = smc.grid(["sprung_cart"], laws, ["nominal"], 2, "default", 0.1)
    assert pickle.loads(pickle.dumps(runs)) == runs
    print(len(smc.study(runs, "here")), len(smc.study(runs, "here")))
"""


@pytest.mark.slow
def test_the_template_installs_offline_and_passes_its_tests(tmp_path):
    target = tmp_path / "site"
    clean = {}
    for k, v in os.environ.items():
        if not k.startswith(("PYTEST_", "PYTHON")):
            clean[k] = v

    def run(*command: object) -> str:
        words = [sys.executable, *map(str, command)]
        paths = os.pathsep.join(map(str, (target, ROOT)))
        done = subprocess.run(
            words,
            cwd=tmp_path,
            env=clean | {"PYTHONPATH": paths},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    offline = ("--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check")
    run(
        "-m",
        "pip",
        "install",
        "-q",
        *offline,
        "--target",
        target,
        EXAMPLE,
    )
    assert (target / "my_smc_package" / "models" / "sprung_cart.xml").is_file()
    (tmp_path / "use.py").write_text(USE)
    assert run("-W", "error", "use.py").splitlines() == ["4 4"]
    assert "4 passed" in run(
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        EXAMPLE / "tests",
    )
    assert "sprung_cart" in run("-m", "smc_mujoco", "list")
    listed = run("-m", "smc_mujoco", "list", "--full", "--json", "-")
    assert listed.count("[my-smc-package]") == 3
