"""Legends have as many columns as fit, and pages one column of panels where two would be too
narrow.
"""

import numpy as np
import pytest
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.draw import lettering, page, style


def wide(labels: list[str], columns: int, size: float) -> float:
    """The width in points of labels with their samples in so many columns."""
    widths = []
    for label in labels:
        widths.append(
            max(lettering.width(line, size) for line in label.split("\n"))
            + (page.ENTRY_SAMPLE + page.ENTRY_SPACE) * size
        )
    return sum(max(part) for part in np.array_split(widths, columns))


@pytest.mark.quick
@pytest.mark.parametrize("width", [3.5, 5.0, 7.16, 12.8])
@pytest.mark.parametrize("count", [1, 2, 3, 5, 9, 14])
def test_a_legend_has_the_most_columns_that_fit_on_its_page_and_no_entry_is_longer_than_its_share(
    width, count
):
    handles = []
    for k in range(count):
        handles.append(Line2D([], [], label="law " * (1 + 7 * k % 5)))
    with style.page(width):
        labels, columns = page._legend(handles, width)
        size = style.points(page.TEXT_SIZE)
        room = 72 * width - 16
        assert columns == 1 or wide(labels, columns, size) < room
        for more in range(columns + 1, count + 1):
            assert wide(labels, more, size) >= room
        longest = max(wide([label], 1, size) for label in labels)
        assert longest <= 72 * width * (0.55 if columns > 1 else 0.95) + 1.0


def test_letters_have_11_px_in_a_readme_and_a_slide_has_three_panels_with_letters_of_16_points(
    tmp_path,
):
    """At 800 px ticks had 8 px. A column's PNG had 150 dots an inch."""
    trace = smc.run(smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.2))
    full_page = smc.figure(trace)
    sizes = []
    for text in full_page.findobj(Text):
        if text.get_text().strip():
            sizes.append(float(text.get_fontsize()))
    assert min(sizes) / 72 * 800 / full_page.get_figwidth() > 10.7
    slide = smc.figure(trace, size="slide")
    assert slide.get_size_inches().tolist() == [13.3, 7.5]
    assert len(slide.axes) == 3
    assert {
        label.get_fontsize() for ax in slide.axes for label in (ax.xaxis.label, ax.yaxis.label)
    } == {16.0}
    smc.figure(trace, tmp_path / "a.png", size="ieee-column")
    with Image.open(tmp_path / "a.png") as image:
        assert image.width == int(252 / 72.27 * 400)
