"""The table of a study: its rows are the runs' scores, and from each its run can be made again."""

import dataclasses
import html
import json
import math
import os
from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from helpers.runs import fails_late

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioWarning
from smc_mujoco.common.text import number
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.run_key import condition, run_key
from smc_mujoco.studies.study import Store, study
from smc_mujoco.studies.table import Table, content


def small(seeds: int = 2) -> list[smc.Scenario]:
    return grid(
        ["duffing"],
        ["observer_free", "classical"],
        ["nominal", "noise"],
        seeds,
        "study",
        duration=0.05,
    )


def test_rows_are_the_scores_of_the_runs_in_order(tmp_path):
    scenarios = small()
    table = study(scenarios, tmp_path)
    for s, row in zip(scenarios, table.rows(), strict=True):
        assert row["hash"] == run_key(s)
        scores = smc.score(smc.run(s))
        assert {name: row[name] for name in scores} == {
            n: None if math.isnan(v) else v for n, v in scores.items()
        }
        assert row["plant"] == s.plant.name
        assert row["law"] == s.law.name
        assert row["condition"] == condition(s)
        assert row["seed"] == s.seed
        assert row["duration"] == s.duration
        assert json.loads(row["gains"]) == dict(s.law.gains)
        assert row["failure"] is None
        assert row["diverged_at"] is None
        assert row["spread_bound"] is None


def test_equal_runs_are_one_row_where_the_first_stands(tmp_path):
    first, second, *_ = small(seeds=1)
    table = study([second, first, second, first], tmp_path)
    assert table.column("hash").tolist() == [run_key(second), run_key(first)]


def test_a_table_is_read_back_selected_and_run_again(tmp_path):
    scenarios = small()
    study(scenarios, tmp_path)
    table = Table.read(tmp_path / "results.parquet")
    assert table.rows() == Table.read(tmp_path).rows()
    chosen = table.select(law="classical", condition=["noise"])
    assert set(zip(chosen.column("law"), chosen.column("condition"), strict=True)) == {
        ("classical", "noise")
    }
    i = len(chosen) - 1
    assert chosen.scenario(i) == scenarios[-1]
    assert np.array_equal(chosen.trace(i).x, smc.run(scenarios[-1]).x)
    assert smc.score(chosen.trace(-1))["itae"] == chosen.column("itae")[-1]
    assert np.isnan(table.column("spread_bound")).all()
    with pytest.raises(smc.ScenarioError, match="did you mean 'classical'"):
        table.select(law="clasical")
    with pytest.raises(smc.ScenarioError, match="unknown plant of this table 3"):
        table.select(plant=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(smc.ScenarioError, match="unknown column"):
        table.column("itaee")
    with pytest.raises(smc.ScenarioError, match="has no row 8"):
        table.scenario(8)


@pytest.mark.quick
def test_what_is_no_table_is_one_sentence(tmp_path):
    with pytest.raises(smc.ScenarioError, match="no table at"):
        Table.read(tmp_path)
    (tmp_path / "results.parquet").write_text("nothing")
    with pytest.raises(smc.ScenarioError, match="is not a table"):
        Table.read(tmp_path)


def flipped(data: bytes, bits: int) -> Iterator[bytes]:
    """The data with one bit flipped, so many times, all over it."""
    for i in range(bits):
        bit = i * (8 * len(data)) // bits + i % 7
        yield data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :]


@pytest.mark.slow
def test_no_bit_that_flips_makes_a_table_of_other_rows(tmp_path):
    right = repr(study(small(), tmp_path).rows())
    path = tmp_path / "results.parquet"
    refused = 0
    for damaged in flipped(path.read_bytes(), 120):
        path.write_bytes(damaged)
        try:
            assert repr(Table.read(path).rows()) == right
        except smc.ScenarioError:
            refused += 1
    assert refused > 40


@pytest.mark.slow
def test_no_bit_that_flips_in_a_part_makes_other_rows(tmp_path):
    right = repr(study(small(), tmp_path).rows())
    (path,) = (tmp_path / "parts").glob("*.parquet")
    lost = 0
    for damaged in flipped(path.read_bytes(), 48):
        path.write_bytes(damaged)
        store = Store(tmp_path)
        store.open(resume=True)
        if not store.where:
            lost += 1
            continue
        assert len(store.where) == len(small())
        store.collect([run_key(s) for s in small()], lambda name: {})
        assert repr(Table.read(tmp_path).rows()) == right
    assert lost > 8


def test_a_table_without_a_digest_is_read_and_a_part_without_one_is_computed_again(tmp_path):
    rows = study(small(), tmp_path).rows()
    paths = [tmp_path / "results.parquet", *(tmp_path / "parts").glob("*.parquet")]
    for path in paths:  # as another program writes them
        old = pq.read_table(path)
        pq.write_table(
            old.replace_schema_metadata({"scores": old.schema.metadata[b"scores"]}), path
        )
    with pytest.warns(ScenarioWarning, match="another program wrote"):
        assert Table.read(tmp_path).rows() == rows
    store = Store(tmp_path)
    store.open(resume=True)
    assert not store.where


def test_a_digest_of_other_rows_is_refused_and_a_copy_of_some_rows_is_a_table(tmp_path):
    table = study(small(), tmp_path)
    path = tmp_path / "results.parquet"
    metadata = {"digest": pq.ParquetFile(path).metadata.metadata[b"digest"]}
    pq.write_table(table.data.slice(1).replace_schema_metadata(metadata), path)
    with pytest.raises(
        smc.ScenarioError, match="it is damaged, or was changed, since it was written"
    ):
        Table.read(path)
    pq.write_table(table.data.slice(1), path)
    with pytest.warns(ScenarioWarning, match="another program wrote"):
        assert Table.read(path).rows() == table.rows()[1:]


@pytest.mark.filterwarnings("ignore:another program wrote")
def test_columns_of_another_program_are_converted_or_refused(tmp_path):
    table = study(small(), tmp_path / "study")
    names = table.data.column_names

    def read(name, *columns):
        path = tmp_path / "other.parquet"
        changed = table.data.remove_column(names.index(name))
        for column in columns:
            changed = changed.append_column(name, pa.array(column))
        pq.write_table(changed, path)
        return Table.read(path)

    seeds = table.column("seed").tolist()
    assert read("seed", list(map(str, seeds))).column("seed").tolist() == seeds
    with pytest.raises(smc.ScenarioError, match="not a table"):
        read("itae", ["a"] * len(table))
    with pytest.raises(smc.ScenarioError, match="column 'itae' twice"):
        read("itae", [1.0] * len(table), [2.0] * len(table))
    for text in ["{", "[]", None]:
        with pytest.raises(smc.ScenarioError, match="row 0 of the table holds no scenario"):
            read("scenario", [text, *[""] * (len(table) - 1)]).scenario(0)


def test_null_and_nan_are_not_the_same_content():
    columns = ([1.0, None], [1.0, math.nan], [None, 1.0])
    assert len({content(pa.table({"x": pa.array(column)})) for column in columns}) == 3


def test_a_pipe_is_no_table(tmp_path):
    os.mkfifo(tmp_path / "results.parquet")
    with pytest.raises(smc.ScenarioError, match="it is not a regular file"):
        Table.read(tmp_path)


def test_a_law_of_yours_is_in_the_table_with_its_code(tmp_path):
    s = smc.Scenario(plant="duffing", law=fails_late(when=1.0), duration=0.05)
    table = study([s], tmp_path)
    assert smc.score(table.trace(0)) == pytest.approx(
        smc.score(smc.run(s)), rel=0, abs=0, nan_ok=True
    )
    with pytest.raises(smc.ScenarioError, match="came from a file without its code"):
        Table.read(tmp_path).trace(0)


# in notebooks, and as other packages read it


def test_a_notebook_shows_medians_and_the_first_failure(tmp_path):
    table = study(
        grid(["duffing"], ["classical", fails_late()], ["nominal"], 5, "study", duration=0.05),
        tmp_path,
    )
    html_text = table._repr_html_()
    assert "Table(10 runs: 1 plant, 2 laws, 1 condition)" in html_text
    assert f">{number(np.median(table.column('itae')[:5]))}<" in html_text
    failure = table.rows()[5]["failure"]
    assert f"5 of 10 runs failed, first: {html.escape(failure)}" in html_text
    none = dataclasses.replace(table, data=table.data.slice(0, 0))._repr_html_()
    assert "Table(0 runs: 0 plants, 0 laws, 0 conditions)" in none
    assert "failed" not in none


def test_packages_that_speak_arrow_read_the_table_as_it_is(tmp_path):
    table = study(small(), tmp_path)
    assert pa.table(table).equals(table.data)
    old = pa.string()
    new = pa.large_string()
    schema = pa.schema(
        [field.with_type(new) if field.type == old else field for field in table.data.schema]
    )
    assert pa.RecordBatchReader.from_stream(table, schema).schema.field("law").type == new
    pandas = pytest.importorskip("pandas")
    for frame in (table.to_pandas(), pandas.DataFrame(table)):
        assert list(frame.columns) == table.data.column_names
        assert frame["itae"].tolist() == table.column("itae").tolist()
