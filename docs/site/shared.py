"""For the reference: where a docstring explains several names on one line, `x0, v0: ...`, each gets
an entry.
"""

import re

import griffe

LINE = re.compile(r"^( +)((?:\w+, )+)(\w+): ", re.MULTILINE)


class Shared(griffe.Extension):
    """Gives the names before the last one entries that point to it."""

    def on_object(self, *, obj, **_):
        if obj.docstring:
            obj.docstring.value = LINE.sub(each, obj.docstring.value)


def each(found):
    """The lines that stand for one: the text is the last name's."""
    indent, names, last = found.groups()
    earlier = names.rstrip(", ").split(", ")
    return "".join(f"{indent}{name}: with `{last}`.\n" for name in earlier) + f"{indent}{last}: "
