"""JSON has one way to write NaN and infinity, and older ways are read; damaged files are one
sentence.
"""

import contextlib
import dataclasses
import json
import math
import os
import uuid
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import result
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.common import files
from smc_mujoco.common.cache import cached
from smc_mujoco.common.files import (
    clear_abandoned,
    from_json,
    plain_data,
    reading,
    replacing,
    to_json,
    writable,
)
from smc_mujoco.robustness.region_of_attraction import Basin
from smc_mujoco.robustness.region_of_attraction import load_basin as load_map
from smc_mujoco.simulation import scenario_json

WORDS = st.sampled_from(
    ["NaN", "Infinity", "-Infinity", "'NaN", "''-Infinity", "inf", "nan", "null"]
)
LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | WORDS
DATA = st.recursive(
    LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text() | WORDS, inner), max_leaves=20
)


def strict(text: str) -> Any:
    """JSON as other languages read it."""

    def constant(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    return json.loads(text, parse_constant=constant)


def same(a: object, b: object) -> bool:
    """Whether they are equal to the last bit and sign, NaN too."""
    return repr(a) == repr(b)


@given(DATA)
@settings(max_examples=20)
def test_whatever_is_written_is_json_and_comes_back(data):
    assert same(strict(to_json(data)), plain_data(data))
    assert same(from_json(to_json(data)), data)


@pytest.mark.quick
def test_numbers_that_json_lacks_are_words():
    assert to_json({"a": [math.nan, (math.inf, -math.inf)], "b": "NaN"}) == (
        '{"a": ["NaN", ["Infinity", "-Infinity"]], "b": "\'NaN"}'
    )


# every file of ours


def test_maps_of_both_versions(tmp_path):
    axis = np.array([0.0])
    values = np.ones((1, 1))
    odd = Basin(
        plant="duffing",
        law="classical",
        x=axis,
        v=axis,
        outcome=values.astype(np.int8),
        decided_at=math.inf * values,
        unit="rad",
        duration=math.inf,
    )
    text = odd.save(tmp_path / "a.json").read_text()
    strict(text)
    (tmp_path / "old.json").write_text(text.replace('"Infinity"', "Infinity"))
    for name in ("a.json", "old.json"):
        assert same(load_map(tmp_path / name), odd)


@pytest.mark.filterwarnings("ignore:no set of gains")
def test_tunings(tmp_path):
    goal = Objective(conditions=("nominal",), duration=0.2)
    tuned = smc.tune("duffing", "classical", budget=8, objective=goal, searches=1)
    worst = tuned.history[0]._replace(objective=math.inf, tracking=math.inf)
    worse = dataclasses.replace(tuned.searches[0], history=(*tuned.history[1:], worst))
    odd = dataclasses.replace(tuned, before=math.nan, searches=(worse,))
    strict(odd.save(tmp_path / "a.json").read_text())
    assert same(result.load_tuned(tmp_path / "a.json"), odd)
    assert result.load_tuned(tmp_path / "a.json").history == odd.history


def test_rows_of_a_study(tmp_path):
    scenario = smc.Scenario(plant="duffing", law=smc.law("super_twisting"), duration=0.01)
    table = smc.study([scenario], tmp_path)
    for column in ("gains", "scenario", "versions"):
        strict(table.column(column)[0])
    assert (
        scenario_json.restore(from_json(table.column("scenario")[0])).law.gains
        == scenario.law.gains
    )


# damaged files


@pytest.mark.parametrize(
    "error",
    [OSError("disk"), MemoryError(), RecursionError("deep"), KeyError("a"), OverflowError()],
)
def test_whatever_reading_raises_is_one_sentence(error, tmp_path):
    (tmp_path / "a").write_text("")
    said = rf"a is not a map \({type(error).__name__}.*\): give another$"
    with (
        pytest.raises(smc.ScenarioError, match=said),
        reading(tmp_path / "a", "map", "give another"),
    ):
        raise error


def test_a_table_that_unpacks_to_too_much_is_refused_before(tmp_path):
    many = pa.table({"x": pa.array(np.zeros(70_000_000))})
    pq.write_table(many, tmp_path / "results.parquet", use_dictionary=False, compression="zstd")
    with pytest.raises(smc.ScenarioError, match="it unpacks to 560 MB, and 500 MB are allowed"):
        smc.Table.read(tmp_path / "results.parquet")


@pytest.mark.parametrize("damage", ["", "[", "5", "[[]]", "[" * 10**5, '[{"plant": 1}]'])
def test_a_damaged_part_of_a_kept_report_is_computed_again(damage, tmp_path):
    odd = [0.1, 0.2, math.inf]
    computations = []

    def make() -> list[float]:
        computations.append(1)
        return odd

    def save(data: list[float], path: Path) -> None:
        files.write_json(path, data)

    def get() -> list[float]:
        return cached(tmp_path / "numbers.json", [], make, save, files.read_json)

    assert get() == get() == odd
    assert len(computations) == 1
    (path,) = tmp_path.iterdir()
    path.write_text(damage)
    assert get() == get() == odd
    assert len(computations) == 2
    (path,) = tmp_path.iterdir()
    text = path.read_text()
    path.write_text(text.replace("0.1", "0.3"))
    assert path.read_text() != text
    assert get() == get() == odd
    assert len(computations) == 3


def test_a_file_is_replaced_as_a_whole(tmp_path):
    """A reader that has opened the old file still reads the old text: nothing is written into that
    file.
    """
    path = tmp_path / "a.json"
    path.write_text("old")
    with path.open() as reader:
        with replacing(path) as part:
            part.write_text("new")
        assert reader.read() == "old"
        assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_whose_writing_fails_stays_as_it_was(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    with contextlib.suppress(ZeroDivisionError), replacing(path) as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_cells_of_a_csv_file_are_between_commas_or_semicolons(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text('\ufeff"t;s", x \n\n0.5,"1,5"\n,\n', encoding="utf-8")
    assert files.csv_rows(file) == [(1, ["t;s", "x"]), (3, ["0.5", "1,5"]), (4, ["", ""])]
    file.write_text('t;"x, m"\n0,5;-1,25\n', encoding="utf-8")
    assert files.csv_rows(file) == [(1, ["t", "x. m"]), (2, ["0.5", "-1.25"])]
    file.write_text("a,b\0\n")
    with pytest.raises(
        smc.ScenarioError,
        match=r"a.csv is not a CSV file \(it is not text|\(Error, line contains NUL",
    ):
        files.csv_rows(file)


def test_what_cannot_be_written_or_found_is_one_sentence(tmp_path):
    cells = "give a CSV file, with commas or semicolons between cells"
    beside = Path(files.__file__).parents[1]
    cure = r"give a name without \0, which UTF-8 can encode"
    refusals = {
        lambda: files.with_ending(
            "a.txt", ".json"
        ): "cannot save to 'a.txt': end the name in .json",
        lambda: files.with_ending("a\0.json", ".json"): rf"the path is 'a\x00.json': {cure}",
        lambda: writable(
            tmp_path
        ): f"cannot write {tmp_path}: it is a folder, give the file in it a name",
        lambda: writable("a\0"): rf"the path is 'a\x00': {cure}",
        lambda: writable("\ud800/a"): rf"the path is '\ud800/a': {cure}",
        lambda: files.shipped(
            "nope"
        ): f"no folder 'nope' in {beside} or beside it: reinstall smc-mujoco",
        lambda: files.csv_rows(tmp_path / "no"): f"no CSV file at {tmp_path / 'no'}: {cells}",
        lambda: files.csv_rows(3): f"cannot read 3: {cells}",  # pyright: ignore[reportArgumentType]
    }
    for call, sentence in refusals.items():
        with pytest.raises(smc.ScenarioError) as refused:
            call()
        assert str(refused.value) == sentence
    assert files.with_ending("b/a.json", ".json") == Path("b/a.json")
    (tmp_path / "old").write_text("old")
    writable(tmp_path / "old")
    writable(tmp_path / "new" / "a")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["new", "old"]
    with pytest.raises(OSError, match="torn"), files.no_room(28):
        raise OSError(5, "torn")
    with pytest.raises(smc.ScenarioError, match=r"written \(full\): make room"), files.no_room(28):
        raise OSError(28, "full")


def test_parts_that_a_killed_process_left_are_deleted_a_day_later(tmp_path):
    """Those that are still written stay, and files of other names."""
    times = {"old": 0.0, "new": None}
    for name, written in times.items():
        for stem in ("a", "b"):
            part = tmp_path / f".{stem}.{uuid.uuid4().hex}.mp4"
            part.write_text(name)
            if written is not None:
                os.utime(part, (written, written))
    clear_abandoned(tmp_path / "a.mp4")
    left_parts = sorted(path.name[1] + path.read_text() for path in tmp_path.iterdir())
    assert left_parts == ["anew", "bnew", "bold"]
