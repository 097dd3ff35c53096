"""The conditions of laws: each function holds where its text, read as mathematics, does, also where both sides meet."""

import math
import re
import types

import numpy as np
import pytest

from smc_mujoco.control.law import catalogue

CONDITIONS = [(name, text) for name, law in sorted(catalogue().items()) for text in law.conditions or {}]
VALUES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 9.0, 128.0, 256.0, 257.0)  # so that sides are often equal


def read(text: str, gains: dict[str, float]) -> bool:
    """Return whether an inequality between gains holds, as it is written."""
    stated, _, some = re.sub(r", (for|or) .*", "", text).partition(" for some ")
    if " is " in stated:
        name, _, listed = stated.partition(" is ")
        return gains[name] in [float(one) for one in re.findall(r"\d+", listed)]
    code = re.sub(r"\|(\w+)\|", r"abs(\1)", stated).replace("^", "**").replace(" = ", " == ")
    code = re.sub(r"^(\w+), (\w+) (> .*)", r"\1 \3 and \2 \3", code)
    factor = r"(?<=[\w)]) (?=(?!and\b|or\b)[a-z(A-Z])(?<!and )(?<!or )"
    code = re.sub(factor, " * ", code)
    space = {"sqrt": math.sqrt, **gains}
    if not some:
        return bool(eval(code, {"__builtins__": {"abs": abs}}, space))
    r = gains["b"] * np.geomspace(1.0, 1e4, 20_000)[1:]
    return bool(np.any(eval(code, {"__builtins__": {}}, {**gains, "r": r})))


@pytest.mark.parametrize(("name", "text"), CONDITIONS, ids=map(str, range(len(CONDITIONS))))
def test_a_condition_holds_where_its_text_does(name, text):
    law, rng, seen = catalogue()[name], np.random.default_rng(0), set()
    for _ in range(600):
        gains = {gain: float(rng.choice(VALUES)) for gain in law.gains}
        if rng.random() < 0.2 and "for some" not in text:
            gains[str(rng.choice([*gains]))] = 0.0
        try:
            stated = read(text, gains)
        except (NameError, KeyError):
            pytest.skip("its text names what is no gain")
        assert bool(law.conditions[text](types.SimpleNamespace(**gains))) is stated, gains
        seen.add(stated)
    assert seen == {True, False}
