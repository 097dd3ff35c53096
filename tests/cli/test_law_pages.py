"""What `smc-mujoco list` promises: every law in a table that fits, one in full, and a new file
found everywhere.
"""

import os
import re
from pathlib import Path

import pytest
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.cli import law_pages, main
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import laws

pytestmark = pytest.mark.quick

ROOT = Path(smc.__file__).parents[1]
EVERY = [
    (name, t) for templates in law_pages.CATALOGUES.values() for name, t in templates().items()
]
ONE_BY_ONE = pytest.mark.parametrize(
    ("name", "template"), EVERY, ids=lambda v: v if isinstance(v, str) else v.kind
)


@pytest.fixture
def call(monkeypatch, capsys):
    """Run the command line in a terminal of 80 columns: (exit code, stdout, stderr)."""
    monkeypatch.setenv("COLUMNS", "80")

    def called(*words):
        with pytest.raises(SystemExit) as end:
            main.main(list(words))
        printed = capsys.readouterr()
        return int(end.value.code or 0), printed.out, printed.err

    return called


def flat(text):
    """Text without its line breaks and columns' spaces."""
    return " ".join(text.split())


# all of them


def test_the_table_has_the_formula(call):
    out = call("list", "laws")[1]
    (line,) = (line for line in out.splitlines() if line.split()[:1] == ["super_twisting"])
    assert "u = -k1 [s]^(1/2) + w, w' = -k2 sgn(s)" in flat(out[out.index(line) :])


# those that suit


def test_a_filter_shows_the_laws_that_have_all_properties_and_no_others(call):
    code, out, err = call("list", "--need", "continuous,finite-time", "--plant", "duffing")
    assert code == 0
    assert err == ""
    assert max(map(len, out.splitlines())) <= 80
    rows = filter(None, map(str.split, out.splitlines()))
    lines = {}
    for name, *rest in rows:
        if name in laws():
            lines[name] = rest
    assert lines["continuous_twisting"][:2] == ["Continuous", "twisting:"]
    assert not {"twisting", "lqr"} & {*lines}
    words = "laws that have a continuous u and bring the error to 0 in finite time"
    assert f"{len(lines)} of {len(laws())} {words}" in flat(out)


def test_a_condition_is_shown_on_the_plant_asked_for(call):
    out = flat(call("list", "friction", "--plant", "duffing")[1])
    assert "Conditions, on duffing for 10 s friction friction=(Coulomb(level=0.1), " in out
    assert call("list", "scenes", "--plant", "duffing")[0] == 2


# one of them


@ONE_BY_ONE
def test_a_page_has_all_that_is_known(name, template: Template, call):
    code, out, err = call("list", name)
    assert code == 0
    assert err == ""
    assert max(map(len, out.splitlines())) <= 80
    text = flat(out)
    for part in (template.doc, *template.conditions):
        assert flat(part) in text
    for gain, value in template.defaults.items():
        assert re.search(rf"\b{gain} += {re.escape(f'{value:g}')}(?=\s|$)", out)
    assert template.kind in text


def test_a_page_has_ranges_degree_plants_and_how_to_use_it(call):
    out = flat(call("list", "pid")[1])
    assert "on a slide N stands for N m, and m for rad" in out
    assert "kp kd > M ki" in out
    assert "tt = 0.5 s > 0" in out
    assert "kp = 10 N m/rad >= 0" in out
    assert "degree 2: acts on e, with u in e''" in out
    assert 'smc.law("pid", kp=10, ki=5)' in out
    assert "plants inverted_pendulum" in flat(call("list", "swing_up")[1])
    assert "none on the gains alone" in flat(call("list", "classical")[1])
    assert 'velocity=smc.estimator("filtered_difference", tau=0.005)' in flat(
        call("list", "filtered_difference")[1]
    )


def test_items_of_a_list_and_equations_keep_lines_of_their_own(call):
    """A formula that goes on with a minus in the next line is no item."""
    items = re.findall(r"^  - (\w+)", call("list", "pd_observer")[1], re.M)
    assert items == ["Incremental", "L1", "ADRC"]
    assert re.search(r"^ +alpha\^2 = ", call("list", "lqi")[1], re.M)
    assert "w tends to the bound" in flat(call("list", "conditioned_super_twisting")[1])
    assert not re.search(r"^ *- ", call("list", "conditioned_super_twisting")[1], re.M)


def test_a_plant_has_a_page_with_its_parameters_and_its_sets(call):
    code, printed, _ = call("list", "quadrotor")
    said = flat(printed)
    assert code == 0
    assert "a free body with four rotors, by default a Crazyflie 2.x." in said
    assert "fmax=0.12" in said
    assert "set hummingbird m=0.5, Jx=0.00365" in said
    assert "set crazyflie the default" in said
    assert max(map(len, printed.splitlines())) <= 80
    assert "set" not in flat(call("list", "duffing")[1]).partition("parameters")[2]


def test_a_law_of_a_file_has_a_page_that_says_how_to_make_it(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_law.py").write_text(LAW)
    code, page, _ = call("list", "my_law.py")
    assert code == 0
    assert 'smc.law("my_law.py", k=4, c=2.5)' in page


# adding a law touches one file

LAW = '''"""Brand new: u = -k sgn(s), s = de + c e.

Explicit. Source: N. Body, "Of no use", J. Nothing 1(1):1, 2001.
"""

from smc_mujoco.control.law import command, law_function, sgn, sliding


@law_function(gains={"k": 4.0, "c": 2.5}, conditions={"k > c": lambda g: g.k > g.c})
def brand_new(y, gains, memory):
    s, eq = sliding(y, gains.c)
    return command(y, eq - gains.k * sgn(s)), s
'''
PLUGIN = """import importlib
importlib.import_module("smc_mujoco.control.laws").__path__.append({folder!r})
"""


@pytest.fixture
def added(tmp_path):
    """A folder with one new law in it, and a plugin that stands for the file being in
    smc_mujoco/control/laws.
    """
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "brand_new.py").write_text(LAW)
    (tmp_path / "added_law.py").write_text(PLUGIN.format(folder=str(folder)))
    return tmp_path


def with_law(added, *words):
    """What a fresh interpreter with that law prints."""
    return python(*words, folder=ROOT, path=f"{ROOT}{os.pathsep}{added}", COLUMNS="80").stdout


def test_a_new_law_is_one_file_in_the_lists_and_on_its_page(added):
    code = """
import added_law, contextlib
import smc_mujoco as smc
from smc_mujoco.cli import main as cli
assert "brand_new" in smc.laws()
for words in (["list"], ["list", "brand_new"]):
    with contextlib.suppress(SystemExit):
        cli.main(words)
"""
    out = with_law(added, "-c", code)
    assert out.count("brand_new") >= 3
    for words in ("k > c", "J. Nothing 1(1):1, 2001", "c = 2.5"):
        assert words in flat(out)
