"""A public function or class takes what is recorded, in this order, with these defaults."""

import inspect
import re

import pytest
from helpers import annexes
from helpers.words import recorded

import smc_mujoco as smc

pytestmark = pytest.mark.quick

HOMES = (
    smc,
    *(
        getattr(smc, name)
        for name in annexes.here(
            ["signals", "hardware", "design", "accuracy", "metrics", "exchange", "envs"]
        )
    ),
)
PUBLIC = {name: getattr(home, name) for home in HOMES for name in home.__all__}
NAMES: dict[str, list[str]] = {room: [] for room in ("core", *annexes.HERE)}
for public_name, public_object in PUBLIC.items():
    if callable(public_object):
        NAMES[annexes.of(public_object.__module__.removeprefix("smc_mujoco.")) or "core"].append(
            public_name
        )


def signature(name):
    """Return a call with its parameters and their defaults, without types."""
    full_signature = inspect.signature(PUBLIC[name])
    plain = []
    for parameter in full_signature.parameters.values():
        plain.append(parameter.replace(annotation=parameter.empty))
    return name + re.sub(" at 0x[0-9a-f]+", "", str(inspect.Signature(plain)))


@pytest.mark.parametrize("room", NAMES)
def test_public_names_take_what_is_recorded(room, snapshot):
    assert "\n".join(map(signature, recorded(__file__, sorted(NAMES[room])))) == snapshot
