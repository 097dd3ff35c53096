"""What the page on entering a law shows works as it stands, and so do the examples of entries."""

import contextlib
import io

import pytest
from helpers.pages import ROOT, blocks, titled

import smc_mujoco as smc
from smc_mujoco.problems import enter, entry, pages, suite

PAGE = ROOT / "docs" / "enter.md"
EXAMPLES = sorted(path for path in (ROOT / "examples" / "entries").iterdir() if path.is_dir())


def test_the_page_s_law_goes_from_its_files_to_a_row_and_is_compared(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(suite, "suite", lambda name: ("duffing/noise@1", "van_der_pol/sine@1"))
    folder = tmp_path / "entries" / "soft_relay"
    folder.mkdir(parents=True)
    for name, text in titled(PAGE).items():
        (folder / name).write_text(text)
        assert (ROOT / "examples" / "entries" / "soft_relay" / name).read_text() == text
    result = enter.enter(folder, instances=2)
    assert {path.name for path in result.iterdir()} == {"runs.parquet", "result.json"}
    (block,) = blocks(PAGE.read_text(), "py")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(block.replace("older.zip", "results/smc-30@1"))
    assert printed.getvalue().count("soft relay") == 5  # its row, and four boards
    assert printed.getvalue().count("0 worse, 0 better") == 4
    pages.build_pages(tmp_path / "results", tmp_path / "pages")
    assert "soft relay" in (tmp_path / "pages" / "smc-30@1.html").read_text()


@pytest.mark.quick
@pytest.mark.parametrize("folder", EXAMPLES, ids=lambda path: path.name)
def test_an_example_of_an_entry_brings_a_plant_home(folder):
    problem = smc.problem(
        "quadrotor/delay_5ms@2" if folder.name == "leaning" else "duffing/noise@1"
    )
    law = entry.read_entry(folder).law(problem.plant)
    (trace,) = smc.run(problem.scenarios(law, [0]))
    assert problem.measures(trace)["settling"] < 4.0
