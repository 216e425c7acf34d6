"""The paper's questions answered by pyAgrum too, where it is installed (the extra ``peers``), and by one einsum."""

from __future__ import annotations

import importlib.util
import warnings

import numpy as np
import pytest

from benchmarks.engine import chain, grid, paper
from benchmarks.peers import engines

CASES = {case.name: case for case in [*paper(), chain(10), grid(2)] if case.model is not None}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("peer", ["einsum", "pyagrum"])
def test_an_engine_that_shares_nothing_with_ours_answers_the_same(name: str, peer: str) -> None:
    if importlib.util.find_spec(peer) is None and peer != "einsum":
        pytest.skip(f"{peer} is not installed (the extra peers)")
    case = CASES[name]
    assert case.model is not None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a peer's own
        able = engines(case.model, case.question)
        assert peer in able
        rng = np.random.default_rng(7)
        compared = 0
        for _ in range(20):
            told = case.evidence(rng)
            ours = case.question(**told).p
            try:
                theirs = able[peer](**told)
            except Exception:  # noqa: BLE001  (pyAgrum calls evidence impossible that is merely unlikely)
                continue
            if np.isfinite(theirs).all():  # and einsum divides nought by nought there
                np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)
                compared += 1
    assert compared >= 5


def test_a_hand_written_answer_is_the_same_too() -> None:
    rng = np.random.default_rng(8)
    for case in CASES.values():
        if case.hand is not None:
            for _ in range(20):
                told = case.evidence(rng)
                np.testing.assert_allclose(case.question(**told).p, case.hand(**told), rtol=1e-9, atol=1e-12)
