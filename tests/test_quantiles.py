import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.quantiles import Quantiles


@given(st.lists(st.floats(1e-5, 1e3), min_size=1, max_size=200), st.sampled_from([0.01, 0.5, 0.99, 1.0]))
def test_a_quantile_is_within_a_per_cent_of_the_sorted_one(values: list[float], share: float) -> None:
    quantiles = Quantiles()
    for value in values:
        quantiles.add(value)
    exact = float(np.quantile(values, share, method="inverted_cdf"))
    found = quantiles.at(share)
    assert found is not None
    assert abs(found - exact) <= 0.011 * exact


def test_nothing_has_no_quantile_and_nought_is_nought() -> None:
    quantiles = Quantiles()
    assert quantiles.at(0.5) is None
    quantiles.add(0.0)
    assert quantiles.at(0.99) == 0.0
