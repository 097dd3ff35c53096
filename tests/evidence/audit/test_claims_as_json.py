"""Claims are JSON that every language reads."""

import math

import pytest
from common.test_files import strict

from smc_mujoco.common.files import to_json
from smc_mujoco.evidence.audit.audit import document
from smc_mujoco.evidence.audit.verdict import Claim


@pytest.mark.quick
def test_numbers_beside_a_claim_are_json():
    words = dict.fromkeys(("id", "text", "where", "measured", "holds_if", "note"), "NaN")
    beside = {"tuned": {"x": math.inf}}
    claim = Claim(
        **words,
        verdict="refuted",
        numbers={},
        beside=beside,
        verdicts={},
        flips=False,
    )
    (reported,) = strict(to_json(document([claim])))["claims"]
    assert reported["beside"] == {"tuned": {"x": "Infinity"}}
