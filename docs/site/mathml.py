"""LaTeX as MathML, which browsers typeset by themselves: a page with equations asks for no script.

Their font is STIX Two Math, as the package ziamath ships it: systems without a font for
mathematics, such as most of Linux, would set them badly.
"""

import functools
import html
import importlib.util
import io
import re
from pathlib import Path

from fontTools import subset
from fontTools.ttLib import TTFont
from latex2mathml.converter import convert

PRIMED = re.compile(
    r"<msup>(<mi>[^<]*</mi>|<mrow>(?:(?!<msup>).)*?</mrow>)<mi>(&#x0203[234];|&#x02057;)</mi></msup>"
)
FUNCTION = re.compile(
    r"\\(sin|cos|tanh|cosh|max|min)(?![A-Za-z])((?:[_^](?:\w|\{\w+\}))*)\s*(?P<bracket>\(?)"
)
MATH = re.compile(r'<(span|div) class="arithmatex">\s*\\([(\[])(.*?)\\[)\]]\s*</\1>', re.DOTALL)
# a minus after a relation, a comma or an opening bracket is a sign; else it would have the space of
# a difference
SIGN = re.compile(
    r"(<mo[^>]*>(?:&#x0003D;|&#x0226[45];|&#x0003[CE];|&#x02192;|&#x0002C;|&#x00028;)</mo>)<mo>&#x02212;</mo>"
)
# Unicode ranges that equations use: Latin, Greek, punctuation, operators, arrows, brackets, italics
LETTERS = [
    (0x20, 0x7E),
    (0xA0, 0xFF),
    (0x2C6, 0x2DC),
    (0x300, 0x308),
    (0x391, 0x3F5),
    (0x2010, 0x2057),
    (0x210E, 0x210F),
    (0x2190, 0x21D4),
    (0x2200, 0x22EF),
    (0x2308, 0x230B),
    (0x23B0, 0x23E1),
    (0x1D434, 0x1D467),
    (0x1D6E2, 0x1D71B),
]
LONG = 60  # letters of LaTeX: what is longer may be wider than a phone, and scrolls


def font() -> bytes:
    """Return the font of equations, without the letters that none has."""
    spec = importlib.util.find_spec("ziamath")
    assert spec is not None
    assert spec.origin is not None
    typeface = TTFont(Path(spec.origin).parent / "fonts" / "STIXTwoMath-Regular.ttf")
    cut = subset.Subsetter(
        subset.Options(layout_features=["ssty", "mark", "mkmk", "dtls"], notdef_outline=True)
    )
    cut.populate(unicodes=[code for first, last in LETTERS for code in range(first, last + 1)])
    cut.subset(typeface)
    file = io.BytesIO()
    typeface.save(file)
    return file.getvalue()


REPAIRS = [  # pattern, replacement: what browsers space or raise wrongly
    (PRIMED, r"<mrow>\1<mi>\2</mi></mrow>"),  # fonts raise a prime already
    (SIGN, r'\1<mo form="prefix">&#x02212;</mo>'),
    (re.compile("<mo>&#x0002F;</mo>"), '<mo lspace="0" rspace="0">/</mo>'),
    (re.compile("<mo>&#x0221E;</mo>"), "<mi>&#x0221E;</mi>"),
]


@functools.cache
def mathml(latex: str, block: bool = False) -> str:
    """Return LaTeX as MathML; a long equation is in an element that scrolls."""
    # else there is space before the second
    latex = latex.replace(r"\lvert", r"\left|").replace(r"\rvert", r"\right|")
    latex = FUNCTION.sub(lambda f: rf"\,\mathrm{{{f[1]}}}{f[2]}" + (f["bracket"] or r"\,"), latex)
    text = convert(latex, display="block" if block else "inline")
    for pattern, replacement in REPAIRS:
        text = pattern.sub(replacement, text)
    if block:
        return f'<div class="equation">{text}</div>'
    if len(latex) > LONG:
        return f'<span class="long equation">{text}</span>'
    return text


def typeset(page: str) -> str:
    """Return a page's HTML with the MathML of its equations."""
    return MATH.sub(lambda found: mathml(html.unescape(found[3]).strip(), found[2] == "["), page)
