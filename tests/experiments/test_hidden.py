"""P(H | Prox) from a run in which H was never written down."""

from __future__ import annotations

import numpy as np

from brp.programs.home import Prox, command, home
from khepera_hil.teaching.hidden import learnt_home, weights


def test_the_sigmoid_is_found_again_in_what_home_did() -> None:
    rng = np.random.default_rng(5)
    rows = []
    for _ in range(6000):
        known = {
            "Dir": int(rng.integers(-9, 10)),
            "Prox": int(rng.integers(16)),
            "Theta1": int(rng.choice(range(-170, 181, 10))),
        }
        rows.append({**known, "Vrot": home(**known).draw(rng)})
    found = weights(learnt_home(rows, by_hand=True))
    true = np.array([command(Prox=prox)["avoidance"] for prox in Prox.values])
    assert np.abs(found - true).max() < 0.09
