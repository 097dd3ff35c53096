"""In every scene's figure and film, and in every clip, nothing is cut or overprinted: by boxes.

No text leaves its picture, meets another one or a curve, or ends in an ellipsis; no peak of a run
that lasts is cut without an arrow; and each machine fills half of its tile.
"""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from helpers.boxes import check, recorded, words_of

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw import wording
from smc_mujoco.draw.film import film
from smc_mujoco.studies import scene as scenes

ROOT = Path(__file__).parents[2]
LONGEST = 1.0  # s, of a run, whose words are those of the whole
SMALLEST = 0.5  # of a tile's height or width, for its machine


def check_curves(page):
    for ax in page.axes:
        low, high = ax.get_ylim()
        arrows = any(line.get_marker() in (2, 3) for line in ax.lines)
        for line in ax.lines:
            if len(line.get_xdata()) < 3 or line.get_transform() != ax.transData:
                continue
            places = ax.transData.transform(line.get_xydata())
            for text in ax.texts:
                box = text.get_window_extent()
                assert not box.shrunk(0.96, 0.8).count_contains(places), text.get_text()
            if ax.get_xlabel().startswith("time") or not ax.get_xlabel():
                y = np.asarray(line.get_ydata(), float)
                y = y[np.isfinite(y)]
                assert arrows or (y.min() >= low and y.max() <= high), ax.get_ylabel()


def runs(name):
    """The runs of a scene's film, and what it calls them."""
    scene = scenes.read_scene(scenes.find(name))
    scenarios = scene.conditions[scene.film]
    short = []
    for scenario in scenarios.values():
        change = scenario.jump.time if scenario.jump else 0.0
        if scenario.fault:
            change = scenario.fault.at
        length = min(scenario.duration, max(LONGEST, 1.1 * change))
        short.append(dataclasses.replace(scenario, duration=length))
    title = scene.title
    if len(scene.conditions) > 1:
        title += f", {scene.film}"
    return smc.run(short), [*map(wording.label, scenarios)], title, scene.camera


SCENES = []
for name in sorted(path.stem for path in (ROOT / "scenes").glob("*.py")):
    quick = name == "chattering"
    SCENES.append(name if quick else pytest.param(name, marks=pytest.mark.slow))


@pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore::smc_mujoco.errors.ScenarioWarning")
def test_a_scene_s_pictures_cut_and_overprint_nothing(name, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scenes"))
    boxes, shares = recorded(monkeypatch)
    traces, labels, title, chosen = runs(name)
    page = smc.figure(traces, labels=labels, title=title)
    words_of(page, monkeypatch, whole=True)
    if all(trace.diverged_at is None for trace in traces):
        check_curves(page)
    half_time = 0.5 * min(trace.t[-1] for trace in traces)
    [*_] = film.Frames(traces, labels, title, camera=chosen, at=half_time)
    check(boxes)
    assert min(shares) >= SMALLEST
