"""The tutorial notebooks: they run from top to bottom, show what their text says, and are kept
without outputs.
"""

import ast
import json
import textwrap
from pathlib import Path

import pytest
from helpers import annexes
from helpers.commands import python

from smc_mujoco.common import gl

ROOT = Path(__file__).parents[1]
NOTEBOOKS = [
    path
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
    if not annexes.lacking(path.read_text("utf-8"))
]
KERNEL = ROOT / "docs" / "site" / "kernel.py"

# Films have a few frames, which else take half of the time.
QUICK = """
from smc_mujoco.draw.film import pace
pace.clock = lambda traces, fps, speed, clock=pace.clock: clock(traces, fps, 15.0)
del pace
"""

# What a notebook's text says of its numbers, as a last cell.
SAID = {
    "law_in_ten_lines": """
        assert scores["tv_rate"] < 0.1 < 500 < smc.score(traces[1])["tv_rate"]
        tv = {(b.group["condition"], e.law): e.interval for b in boards if b.metric == "tv_rate" for e in b.entries}
        assert tv["noise", "my_law"].low > 1e3 * tv["nominal", "my_law"].high
        assert any(board.winner for board in boards)
    """,
    "pid_against_sliding_mode": """
        late = [trace.u[2001:, 0] - trace.u[2001:, 0].mean() for trace in loaded]
        amplitudes = [2.0 * abs(np.fft.rfft(u)) / u.size for u in late]
        assert 170 < amplitudes[1][:250].argmax() < 195 and amplitudes[2].argmax() == 250
        assert amplitudes[0].max() < 1e-4 < amplitudes[2].max() < 0.1 < amplitudes[1].max()
        assert max(smc.score(trace)["ultimate_bound"] for trace in noisy) < 0.002
        for check, right, wrong in (
            (check_offset, [0.0216, np.float32(0.0216)], [0.0205, -0.0216]),
            (check_load, [1.576], [1.3, 6.0]),
            (check_width, [2.0], [0.5, 4.0]),
        ):
            assert {check(answer)[:5] for answer in right} == {"Right"}
            assert [check(answer)[:7] for answer in wrong] == ["Not yet"] * 2
        for check in (check_load, check_width):
            assert check(None).startswith("Write")
            assert {check(answer)[:7] for answer in (-1.0, 0.0, float("nan"), 1576.0)} == {"Not yet"}
        assert "in degrees?" in check_offset(np.degrees(0.0216))
        assert "in mrad?" in check_offset(21.6)
        assert "Is it in N m?" in check_load(1576.0) and "on average" in check_load(6.0)
        assert "Is it in N m?" in check_load(0.001576) and "Is phi in rad/s?" in check_width(0.035)
        assert "Is phi in rad/s?" in check_width(97.4) and "Is it in rad/s?" in check_width(115.0)
        at_bound = [abs(trace.u) >= 6.0 for trace in starts]
        assert at_bound[0][0] and not at_bound[0][100:].any() and not at_bound[2].any()
        boundary_layer = smc.law("boundary_layer", plant=PLANT).gains
        assert (boundary_layer["k"], boundary_layer["c"]) == (17.96, 15.43)
        told = " ".join(str(compared).split())
        assert "J on unseen runs of inverted_pendulum: no winner; no law is shown to be better than pid or super_twisting" in told
        assert "ITAE on inverted_pendulum under nominal: pid wins" in told
        assert "ITAE on inverted_pendulum under noise: super_twisting wins" in told
    """,
    "your_robot": """
        largest = [abs(t.x - t.r)[t.t > 2.0].max() for t in (*traces, *worse)]
        assert max(largest[:2]) < 0.01 < min(largest[2:])
    """,
    "audit_a_claim": """
        assert [claim.verdict for claim in claims] == ["supported", "refuted", "refuted"]
        s = trace.s[:, 0]
        assert s[0] > 0.0 and s.min() < -0.1 and 0.05 < rises.mean() < 0.15
        assert boards[0].winner == "observer_free"
        tv = {(b.condition, law): b.medians[law] for b in boards[0].blocks for law in b.medians}
        gain = {at: tv[at, "classical"] / tv[at, "observer_free"] for at in ("nominal", "noise")}
        assert gain["nominal"] > 1000.0 and 1.0 < gain["noise"] < 20.0
    """,
}


def cells(path: Path) -> list[tuple[str, str]]:
    """The kind and the text of each cell."""
    return [
        (cell["cell_type"], "".join(cell["source"]))
        for cell in json.loads(path.read_text("utf-8"))["cells"]
    ]


def code(path: Path) -> list[str]:
    return [text for kind, text in cells(path) if kind == "code"]


@pytest.mark.quick
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs_as_jupyter_saves_it(path):
    text = path.read_text("utf-8")
    data = json.loads(text)
    assert text == json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    assert data["nbformat"] == 4
    assert data["nbformat_minor"] == 5
    assert data["metadata"]["kernelspec"]["name"] == "python3"
    assert len({cell["id"] for cell in data["cells"]}) == len(data["cells"])
    for cell in data["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.slow
def test_a_notebook_runs_and_shows_what_its_text_says(path, tmp_path):
    if any("smc.show(" in text for text in code(path)) and gl.missing_renderer():
        pytest.skip(str(gl.missing_renderer()))
    said = textwrap.dedent(SAID[path.stem])
    done = python(KERNEL, path, "shown.json", QUICK, said, folder=tmp_path)
    assert done.stdout == ""
    printed = json.loads((tmp_path / "shown.json").read_text())
    for text, outputs in zip(code(path), printed, strict=True):
        last = ast.parse(text).body[-1]
        if not isinstance(last, ast.Expr) or "print(" in text:
            continue
        call = ast.unparse(last).partition("(")[0]
        kinds = set()
        for output in outputs:
            for kind in output:
                kinds.add(kind)
        if call in ("smc.figure", "smc.plot", "plt.show"):
            assert "image/png" in kinds, text
        elif call == "smc.show":
            assert any(output["text/html"].startswith("<video") for output in outputs), text
        elif isinstance(last.value, ast.Name | ast.Subscript) and call != "arm":
            assert "text/html" in kinds, text
        else:
            assert outputs, text
