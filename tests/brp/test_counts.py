"""Forms that count, tables with shares, and large numeric domains."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    Form,
    Gaussian,
    Histogram,
    ImpossibleEvidence,
    Laplace,
    Nearest,
    P,
    Specification,
    SpecificationError,
    Switch,
    Table,
    Unidentified,
    Uniform,
    Variable,
)
from brp.factors import Density
from tests.brp.campaign import examples

A = Variable("A", range(7))
B = Variable("B", ("red", "green", "blue"))
C = Variable("C", range(3))

O = Variable("O", range(16))  # noqa: E741  (the paper's name for the class of an object)
Nlt = Variable("Nlt", range(25))
Per = Variable("Per", range(10_000))

rows = st.lists(
    st.tuples(st.integers(0, 6), st.sampled_from(("red", "green", "blue")), st.integers(0, 2)), max_size=30
)
counting = st.one_of(
    st.builds(Laplace, bins=st.none() | st.integers(1, 7)),
    st.builds(
        Histogram,
        bins=st.none() | st.integers(1, 7),
        unvisited=st.sampled_from(["uniform", Nearest(), Nearest(within=lambda C: C > 0)]),
    ),
)


@examples(60)
@given(counting, rows)
def test_every_counting_form_sums_to_one_over_its_left_side(form: Form, data: list[tuple[int, str, int]]) -> None:
    specification = Specification({P(C): Uniform(), P(B): Uniform(), P(A | B, C): form})
    learnt = specification.identify({"A": a, "B": b, "C": c} for a, b, c in data)
    if not data and isinstance(form, Histogram):
        with pytest.raises(Unidentified, match=r"P\(A \| B C\)"):
            learnt.ask(P(A | B, C))
        return
    question = learnt.ask(P(A | B, C))
    for b in B.values:
        for c in C.values:
            assert question(B=b, C=c).p.sum() == pytest.approx(1, abs=1e-12)


@examples(60)
@given(rows)
def test_a_laplace_law_is_the_footnotes_formula(data: list[tuple[int, str, int]]) -> None:
    """Footnote 16: (1 + n_v) / (N + |V|), here of a conjunction of 21 values."""
    learnt = Specification({P(C): Laplace(), P(A, B | C): Laplace()}).identify(
        {"A": a, "B": b, "C": c} for a, b, c in data
    )
    both, alone = learnt.ask(P(A, B | C)), learnt.ask(P(C))()
    for c in C.values:
        n = sum(datum[2] == c for datum in data)
        assert alone[c] == pytest.approx((n + 1) / (len(data) + 3), rel=1e-12)
        for a in A.values:
            n_v = sum(datum == (a, "green", c) for datum in data)
            assert both(C=c)[a, "green"] == pytest.approx((n_v + 1) / (n + 21), rel=1e-12)


def test_a_histogram_is_the_frequencies_and_excludes_what_was_never_seen() -> None:
    learnt = Specification({P(C): Uniform(), P(B | C): Histogram()}).identify(
        {"C": [0, 0, 0, 0, 1], "B": ["red", "red", "red", "blue", "green"]}
    )
    question = learnt.ask(P(B | C))
    assert question(C=0).p.tolist() == [0.75, 0, 0.25]
    assert question(C=1).p.tolist() == [0, 1, 0]
    assert question(C=2).p.tolist() == pytest.approx([1 / 3] * 3)
    nearest = Specification({P(C): Uniform(), P(B | C): Histogram(unvisited=Nearest())})
    assert nearest.identify({"C": [0, 1], "B": ["red", "green"]}).ask(P(B | C))(C=2).best() == "green"
    nobody = Specification({P(C): Uniform(), P(B): Histogram(), P(A | B, C): Uniform()}).identify({"B": ["red"]})
    with pytest.raises(ImpossibleEvidence, match="B = green, C = 0 is impossible"):
        nobody.ask(P(A | B, C))(B="green", C=0)


def test_values_share_the_probability_of_their_bin_equally() -> None:
    """Seven values in three bins: 0 1 2, 3 4, 5 6."""
    learnt = Specification({P(A): Laplace(bins=3)}).identify({"A": [0, 2, 2, 6]})
    np.testing.assert_allclose(
        learnt.ask(P(A))().p, [4 / 21, 4 / 21, 4 / 21, 1 / 14, 1 / 14, 2 / 14, 2 / 14], rtol=1e-12
    )
    with pytest.raises(SpecificationError, match=r"8 bins do not fit P\(A\)"):
        Specification({P(A): Laplace(bins=8)})
    with pytest.raises(SpecificationError, match="at least one bin"):
        Histogram(bins=0)


@pytest.mark.parametrize("form", [Laplace(), Histogram()])
def test_data_drawn_from_a_law_identify_it_again(form: Form) -> None:
    """Chi square of 30 000 draws with a fixed seed."""
    rng = np.random.default_rng(11)
    table = rng.dirichlet(np.full(7, 2.0), size=3).T
    source = Specification({P(C): Uniform(), P(A | C): Table(table)}).identify().ask(P(A | C))
    c = rng.integers(0, 3, 30_000)
    data = {"C": c, "A": [source(C=int(value)).draw(rng) for value in c]}
    learnt = Specification({P(C): Uniform(), P(A | C): form}).identify(data).ask(P(A | C))
    # Six degrees of freedom for each value of C; chance passes 22.5 once in 1000.
    for value in range(3):
        n, p = int((c == value).sum()), learnt(C=value).p
        assert (n * (p - table[:, value]) ** 2 / table[:, value]).sum() < 22.5


def test_each_case_of_a_switch_counts_its_own_samples() -> None:
    specification = Specification(
        {P(C): Uniform(), P(B | C): Switch(C, {0: Uniform(), (1, 2): Laplace()})}, name="pi-object"
    )
    learnt = specification.identify({"C": [0, 1, 2, 2], "B": ["red", "red", "red", "blue"]}).ask(P(B | C))
    assert learnt(C=0).p.tolist() == pytest.approx([1 / 3] * 3)
    assert learnt(C=2).p.tolist() == pytest.approx([1 / 2, 1 / 6, 1 / 3])
    assert learnt(C=1).p.tolist() == learnt(C=2).p.tolist()


def test_an_x_is_an_equal_share_of_what_is_left_in_its_column() -> None:
    """Table 2 of the paper, its first three columns."""
    Before = Variable("Behavior_t-1", ("idle", "patrol", "recognition"))
    Now = Variable("Behavior", ("idle", "patrol", "recognition", "fire-intervention", "homing", "recharge"))
    x = "x"
    array = [[0.9, x, 0], [x, 0.9, x], [0, x, 0.99], [x, x, x], [0, x, x], [0, x, 0]]
    mapping = {
        "idle": {"idle": 0.9, "patrol": x, "fire-intervention": x},
        "patrol": [x, 0.9, x, x, x, x],
        "recognition": {"patrol": x, "recognition": 0.99, "fire-intervention": x, "homing": x},
    }
    for table in (array, mapping):
        question = (
            Specification({P(Before): Uniform(), P(Now | Before): Table(table)}).identify().ask(P(Now | Before))
        )
        np.testing.assert_allclose(question(Behavior_t_1="idle").p, [0.9, 0.05, 0, 0.05, 0, 0], atol=1e-15)
        np.testing.assert_allclose(question(Behavior_t_1="patrol").p, [0.02, 0.9, 0.02, 0.02, 0.02, 0.02])
        np.testing.assert_allclose(
            question(Behavior_t_1="recognition").p, [0, 0.01 / 3, 0.99, 0.01 / 3, 0.01 / 3, 0], atol=1e-15
        )


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ([0.7, 0.7, "x"], "no probability"),
        ([0.7, 0.3, "y"], 'neither a number nor "x"'),
        ([0.7, 0.3, float("nan")], "no probability"),
        ([0.5, 0.4, 0.0], "sums to 0.9"),
    ],
)
def test_a_table_that_leaves_no_shares_is_refused(table: list[object], sentence: str) -> None:
    with pytest.raises(SpecificationError, match=sentence):
        Specification({P(B): Table(table)})


def test_a_gaussian_over_ten_thousand_values_is_two_numbers_a_class() -> None:
    """Asked for the class of an object it never makes the table of 16 x 10 000 numbers (1.3 MB)."""
    specification = Specification(
        {P(O): Uniform(), P(Nlt | O): Laplace(), P(Per | O): Gaussian(unvisited="uniform", floor=5)}
    )
    rng = np.random.default_rng(3)
    o = rng.integers(1, 16, 300)
    per = np.clip(np.rint(rng.normal(200 + 500 * o, 10)), 0, 9999).astype(int)
    learnt = specification.identify({"O": o, "Nlt": o, "Per": per})
    assert len(Per.places) == 10_000  # the dictionary of a variable's values is its own
    tracemalloc.start()
    question = learnt.ask(P(O | Nlt, Per))
    answer = question(Nlt=7, Per=200 + 500 * 7)
    held, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < 160_000 * 8 / 4
    assert most < 100_000_000
    assert answer.best() == 7
    assert learnt.ask(P(Per | O))(O=3).mean() == pytest.approx(per[o == 3].mean(), abs=1e-6)


def test_a_light_density_answers_as_its_table_does() -> None:
    rng = np.random.default_rng(5)
    o = rng.integers(0, 16, 200)
    per = rng.integers(0, 10_000, 200)
    learnt = Specification({P(O): Laplace(), P(Per | O): Gaussian()}).identify({"O": o, "Per": per})
    question = learnt.ask(P(O | Per))
    prior = learnt.ask(P(O))().p
    likelihood = np.array([learnt.ask(P(Per | O))(O=value).p for value in O.values])
    for value in (0, 17, 5000, 9999):
        joint = prior * likelihood[:, value]
        np.testing.assert_allclose(question(Per=value).p, joint / joint.sum(), rtol=1e-10)


@examples(40)
@given(st.floats(-500, 11_000), st.floats(0.05, 900), st.sampled_from([range(10_000), range(9_999, -1, -1)]))
def test_a_gaussian_over_many_values_is_normalised_over_all_of_them(
    mean: float, deviation: float, values: range
) -> None:
    """Its sum looks only at the values near the mean, and must not be able to tell."""
    Long = Variable("Long", values)
    p = Specification({P(Long): Gaussian(mean, deviation)}).identify().ask(P(Long))().p
    exponent = -0.5 * ((Long.numbers - mean) / deviation) ** 2
    expected = np.exp(exponent - exponent.max())
    np.testing.assert_allclose(p, expected / expected.sum(), rtol=1e-11, atol=1e-300)
    form = Specification({P(Long): Gaussian(mean, deviation)}).identify()
    (factor,) = form.relevant(P(Long))
    assert isinstance(factor, Density)
    np.testing.assert_allclose(np.exp(factor.log(np.arange(10_000))).sum(), 1, rtol=1e-12)
