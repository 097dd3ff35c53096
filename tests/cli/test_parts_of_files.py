"""A friction of a user's file goes through the shell as a law of one does: FILE.py:NAME."""

import pickle
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from helpers.machine_logs import chain
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective, restored_objective
from smc_mujoco.cli.commands import options
from smc_mujoco.cli.main import app
from smc_mujoco.common.scripts import object_named
from smc_mujoco.simulation import run_key, scenario_json, workers
from smc_mujoco.simulation.conditions import find_condition, from_file
from smc_mujoco.testing.response import respond

STRIBECK = """import math

import smc_mujoco as smc


@smc.hardware.friction_function(numbers={"coulomb": 0.2, "static": 0.5, "speed": 0.1})
def stribeck(y, p, memory):
    return p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))
"""
MORE = f"""{STRIBECK}

@smc.hardware.actuator_function(numbers={{"zone": 0.1}})
def dead_zone(y, p, memory):
    return y.u - min(max(y.u, -p.zone), p.zone)


worn = stribeck(static=0.9)
dusty = smc.condition("dusty", friction=worn)
PORT = 80
"""
PAIR = "pid(kp=30,ki=5,kd=6),slow: pid(kp=10,ki=1,kd=4)"


@pytest.fixture
def parts(tmp_path, monkeypatch) -> Path:
    """A working folder with a file of parts."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])
    file = tmp_path / "my parts.py"
    file.write_text(MORE)
    (tmp_path / "my_parts.py").write_text(MORE)
    return tmp_path


def shell(*words: object) -> str:
    """Run a command, and return what it prints."""
    answer = CliRunner().invoke(app, [str(word) for word in words])
    assert answer.exit_code == 0, answer.output
    return answer.output


@pytest.mark.quick
@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("friction=my_parts.py:stribeck", (0.2, 0.5)),
        ("friction=my_parts.py:stribeck(0.3, static=0.4), x0=0.2", (0.3, 0.4)),
        ("friction={'*':my_parts.py:stribeck(static=0.4)}", (0.2, 0.4)),
        ("friction='my parts.py:stribeck'(static=0.4)", (0.2, 0.4)),
        ("friction=(my_parts.py:worn, Coulomb(0.1))", (0.2, 0.9)),
    ],
)
def test_a_text_names_a_part_of_a_file_and_is_written_so_that_it_can_be_read_again(
    text, levels, parts
):
    mine = find_condition(f"mine: {text}")
    parts_of_run = smc.Scenario(plant="duffing", law="pid", **mine.fields).friction
    (friction,) = (part for part in parts_of_run if not isinstance(part, smc.Coulomb))
    assert (friction.coulomb, friction.static) == levels
    again = find_condition(str(mine))
    assert again == mine
    assert "parts.py:" not in mine.brief(smc.plant("duffing"), 1.0)


@pytest.mark.quick
def test_a_file_has_conditions_and_drives_too(parts):
    assert find_condition("my_parts.py:dusty").name == "dusty"
    drive, lag = options.actuator("my_parts.py:dead_zone(zone=0.3)+lag:0.01")
    assert (drive.zone, lag) == (0.3, smc.Lag(0.01))


@pytest.mark.quick
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("m: friction=no.py:stribeck()", ("no file 'no.py'",)),
        ("m: friction=my_parts.py:PORT", ("no part", "'PORT'", "stribeck", "dead_zone", "worn")),
        ("m: friction=my_parts.py:stribeck(level=1)", ("it takes coulomb, static, speed",)),
        ("m: friction=my_parts.py:worn(static=1)", ("leave its brackets out",)),
        ("my_parts.py:stribeck", ("stribeck: friction=my_parts.py:stribeck", "it has dusty")),
    ],
)
def test_what_a_file_lacks_is_one_sentence(text, words, parts, refused):
    refused(lambda: find_condition(text), *words)


@pytest.mark.quick
@pytest.mark.parametrize("rest", ["(zone=", "(zone=0.3), u_max=2"])
def test_a_drive_of_a_file_that_cannot_be_read_is_one_sentence(rest, parts, refused):
    refused(lambda: options.actuator(f"my_parts.py:dead_zone{rest}"), "cannot be read", "gap=0.1")


@pytest.mark.quick
def test_a_part_is_itself_until_its_file_changes_and_then_a_run_has_another_key(parts):
    def key() -> str:
        mine = find_condition("mine: friction=my_parts.py:stribeck(static=0.3)")
        return run_key.run_key(smc.Scenario(plant="duffing", law="pid", **mine.fields))

    def kind() -> type:
        return object_named("my_parts.py:stribeck", "part", callable)

    first, same = key(), kind()
    assert (key(), kind()) == (first, same)
    (parts / "my_parts.py").write_text(MORE.replace("p.speed) ** 2", "p.speed) ** 4"))
    assert key() != first


@pytest.mark.quick
def test_a_record_runs_no_file_that_it_names(parts, refused):
    (parts / "evil.py").write_text("raise SystemExit('it was run')")
    mine = find_condition("mine: friction=my_parts.py:stribeck(static=0.3)")
    data = Objective(conditions=(mine,)).describe()
    assert data["conditions"] == ["mine: friction=stribeck(coulomb=0.2, static=0.3, speed=0.1)"]
    data["conditions"] = ["mine: friction=evil.py:stribeck()"]
    refused(lambda: restored_objective(data), "evil.py", "a record runs none")
    about = scenario_json.describe(smc.Scenario(plant="duffing", law="pid", **mine.fields))
    about["friction"][0]["kind"] = "other"
    refused(lambda: scenario_json.restore(about), "'other'", "runpy.run_path")


def _key(data: bytes) -> str:
    return run_key.run_key(pickle.loads(data))


@pytest.mark.slow
def test_another_process_knows_a_part_of_a_file_by_the_same_key(parts):
    """A class is sent without what its base says, so that must not count."""
    pytest.importorskip("cloudpickle")
    mine = find_condition("mine: friction=my_parts.py:stribeck(static=0.3)")
    scenario = smc.Scenario(plant="duffing", law="pid", **mine.fields)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        key = pool.submit(_key, workers.packed(scenario)).result()
    assert key == run_key.run_key(scenario)


@pytest.mark.slow
def test_compare_takes_a_friction_of_a_file_and_resumes(parts):
    words = ["compare", "duffing", "--law", PAIR, "--allow-defaults", "--seeds", "2"]
    words += ["--duration", "1", "--out", "there", "--condition"]
    own = shell(*words, "mine: friction=my_parts.py:stribeck(static=0.3)")
    assert "mine" in own
    stored = sorted((parts / "there" / "parts").iterdir())
    assert stored
    (parts / "mine.txt").write_text("mine: friction='my parts.py:stribeck'(static=0.3)\n")
    shell(*words, "mine.txt")
    assert sorted((parts / "there" / "parts").iterdir()) == stored
    library = "mine: friction=Stribeck(coulomb=0.2, static=0.3, stribeck=0.1)"
    scores, *_ = shell(*words, library).partition("Computing time")
    assert own.startswith(scores)  # the library's curve is the same one


@pytest.mark.slow
def test_identify_finds_the_numbers_of_a_friction_of_a_file_which_compare_takes(parts):
    (parts / "arm.xml").write_text(chain([0.4], [1.0]))
    true = find_condition("true: friction=my_parts.py:stribeck(0.3, 0.5, 0.2), input_delay=0.004")
    motion = smc.Sine(0.5, 2.5) + smc.Sine(0.25, 9.0)
    pd = {"law": smc.law("pid", kp=20.0, ki=0.0, kd=1.5), "reference": motion, "duration": 2.0}
    arm = smc.plant_from("arm.xml", ["j1"])
    smc.run(smc.Scenario(plant=arm, **pd, **true.fields)).export("run.csv")
    words = ["identify", "arm.xml", "run.csv", "--out", "found.txt", "--condition"]
    mine = "mine: friction=my_parts.py:stribeck(static=0.5, speed=0.2)"
    shell(*words, mine, "--for", "friction.coulomb,input_delay")
    (condition,) = from_file(Path("found.txt"))
    friction = smc.Scenario(plant=arm, law="pid", **condition.fields).friction[0]
    assert friction.coulomb == pytest.approx(0.3, rel=0.01)
    assert "friction=(my_parts.py:stribeck(" in Path("found.txt").read_text()
    compared = ["compare", "arm.xml:j1", "--law", PAIR, "--allow-defaults", "--seeds", "2"]
    assert "identified" in shell(*compared, "--duration", "1", "--condition", "found.txt")


@pytest.mark.quick
def test_identify_refuses_what_no_replay_has(refused):
    refused(
        lambda: smc.identify("duffing", {"t": [0.0]}, ["m"], condition="noise"),
        "'noise' has noise",
        "it may have friction",
    )


def test_a_command_that_takes_one_condition_takes_it_from_a_file(tmp_path, refused):
    """`margins`, `worst`, `sensitivity` and `chatter`, as `compare` does."""
    file = tmp_path / "found.txt"
    file.write_text("# found\nmine: mismatch={'M': 1.2}, friction=Coulomb(0.05)\n")
    run = ["chatter", "duffing", "--law", "classical", "--gains", "default", "--duration", "1"]
    texts = []
    for condition in (file, "mine: mismatch={'M': 1.2}, friction=Coulomb(0.05)", "nominal"):
        printed = shell(*run, "--condition", condition)
        texts.append(printed.partition("gains:")[0])  # without the time that it took
    assert texts[0] == texts[1] != texts[2]
    taken = respond("duffing", "pid", 0.2, str(file), {"duration": 0.1})
    assert taken.condition == "mine, duration=0.1"
    assert taken.scenario.friction == (smc.Coulomb(0.05),)
    file.write_text("a: x0=0.2\nb: x0=0.3\n")
    grid = smc.grid("duffing", "pid", [file, "nominal"], seeds=1, gains="default")
    assert [scenario.condition for scenario in grid] == ["a", "b", "nominal"]
    words = "has 2 conditions ('a' and 'b')", "takes one"
    refused(lambda: respond("duffing", "pid", 0.2, file, {}), *words)
    refused(lambda: respond("duffing", "pid", 0.2, "lost.txt", {}), "no file of conditions at lost")
