"""Boxes of the words of pictures, as they are drawn."""

import itertools
from collections import defaultdict

import numpy as np
from matplotlib.text import Text
from PIL import ImageDraw

from smc_mujoco.draw.film import camera

TOUCH = 1.5  # px by which boxes of letters may overlap: letters fill less


def recorded(monkeypatch):
    """Return what grows while pictures are drawn: boxes of the words that were drawn last, by their
    picture and text, (words, left, low, right, high) px; and the shares of tiles that machines
    reach.
    """
    boxes = defaultdict(dict)
    shares = []
    draw = Text.draw
    write = ImageDraw.ImageDraw.text
    layout = camera.layout

    def noted(text, renderer, *given, **named):
        draw(text, renderer, *given, **named)
        if text.get_visible() and text.get_text().strip() and text.get_color() != "none":
            box = text.get_window_extent(renderer).extents
            figure = text.get_figure(root=True)
            boxes[figure, tuple(figure.bbox.size)][text] = (text.get_text(), *box)

    def written(canvas, place, words, fill=None, font=None, anchor=None, **named):
        box = canvas.textbbox(place, words, font, anchor, named.get("spacing", 4))
        boxes[canvas, canvas.im.size][words, place] = (words, *box)
        write(canvas, place, words, fill, font, anchor=anchor, **named)

    def placed(count, room, sizes, points, turn, *rest, **named):
        tiles, labels, view = layout(count, room, sizes, points, turn, *rest, **named)
        seen = np.ptp(camera.project(points, turn, view.place, view.size), axis=0)
        shares.append(float((seen / view.size).max()))
        return tiles, labels, view

    monkeypatch.setattr(Text, "draw", noted)
    monkeypatch.setattr(ImageDraw.ImageDraw, "text", written)
    monkeypatch.setattr(camera, "layout", placed)
    return boxes, shares


def check(boxes, whole=True):
    """No two words overlap and all are in their picture; if `whole`, none is cut."""
    for (_, size), texts in boxes.items():
        words = texts.values()
        for text, left, low, right, high in words:
            assert not (whole and "…" in text)
            assert min(left, low, size[0] - right, size[1] - high) > -TOUCH, text
        for first, second in itertools.combinations(dict.fromkeys(words), 2):
            apart = max(
                first[1] - second[3],
                second[1] - first[3],
                first[2] - second[4],
                second[2] - first[4],
            )
            assert apart > -TOUCH, (first[0], second[0])


def words_of(page, monkeypatch, whole=False):
    """Return the words of a figure, which are checked."""
    boxes, _ = recorded(monkeypatch)
    page.draw_without_rendering()
    check(boxes, whole)
    return [text for words in boxes.values() for text, *_ in words.values()]
