"""Forms: what they answer, what data make of them, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brp import (
    DataError,
    Dirac,
    Gaussian,
    Nearest,
    NotAValue,
    P,
    Prior,
    Sigmoid,
    Specification,
    SpecificationError,
    Switch,
    Table,
    Unidentified,
    Uniform,
    Variable,
)
from tests.brp.campaign import examples

Dir = Variable("Dir", range(-10, 11))
Prox = Variable("Prox", range(16))
Vrot = Variable("Vrot", range(-10, 11))
H = Variable("H", ("avoidance", "phototaxy"))
x = Vrot.numbers


def normal(mean: float, deviation: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    weight = np.exp(-0.5 * ((x - mean) / deviation) ** 2)
    return np.asarray(weight / weight.sum())


def turning(form: Gaussian) -> Specification:
    return Specification({P(Dir): Uniform(), P(Vrot | Dir): form}, name="pi-turn")


def test_data_identify_mean_and_deviation_of_every_cell() -> None:
    data = {"Dir": [3, 3, 3, -2, -2], "Vrot": [4, 6, 8, -1, 1]}
    description = turning(Gaussian()).identify(data, name="delta")
    question = description.ask(P(Vrot | Dir))
    np.testing.assert_allclose(question(Dir=3).p, normal(6, np.sqrt(8 / 3)), rtol=1e-12)
    np.testing.assert_allclose(question(Dir=-2).p, normal(0, 1), rtol=1e-12)
    assert str(question) == "P(Vrot | Dir delta pi-turn)"


@examples(25)
@given(st.lists(st.tuples(st.integers(-10, 10), st.integers(0, 15), st.integers(-10, 10)), min_size=1, max_size=60))
def test_rows_and_columns_identify_the_same_and_numpy_agrees(rows: list[tuple[int, int, int]]) -> None:
    specification = Specification(
        {P(Dir): Uniform(), P(Prox): Uniform(), P(Vrot | Dir, Prox): Gaussian(floor=1e-9)}
    )
    by_rows = specification.identify({"Dir": d, "Prox": p, "Vrot": v, "other": None} for d, p, v in rows)
    columns = dict(zip(("Dir", "Prox", "Vrot"), np.array(rows).T, strict=True))
    term = P(Vrot | Dir, Prox)
    one, other = by_rows[term], specification.identify(columns)[term]
    means, deviations = one.parameters(term)  # type: ignore[attr-defined]  # an identified Gaussian has them
    np.testing.assert_array_equal((means, deviations), other.parameters(term))  # type: ignore[attr-defined]  # likewise
    d, p, _ = rows[0]
    values = [v for *cell, v in rows if cell == [d, p]]
    assert means[d + 10, p] == pytest.approx(np.mean(values))
    assert deviations[d + 10, p] == pytest.approx(max(1e-9, float(np.std(values))))


def test_data_drawn_from_a_gaussian_identify_it_again() -> None:
    source = turning(Gaussian(mean=lambda Dir: Dir / 2, deviation=2)).identify().ask(P(Vrot | Dir))
    rng = np.random.default_rng(5)
    data = [{"Dir": d, "Vrot": source(Dir=d).draw(rng)} for d in Dir.values for _ in range(400)]
    learnt = turning(Gaussian()).identify(data).ask(P(Vrot | Dir))
    for d in (-8, 0, 5):
        assert learnt(Dir=d).mean() == pytest.approx(d / 2, abs=0.35)


def test_a_cell_that_was_never_visited_answers_as_the_nearest_within_its_borders() -> None:
    form = Gaussian(unvisited=Nearest(within=lambda Dir: Dir > 0))
    learnt = turning(form).identify({"Dir": [-1, 8, 10], "Vrot": [5, -5, -9]}).ask(P(Vrot | Dir))
    assert learnt(Dir=1).best() == -5  # -1 is nearer, but on the other side
    assert learnt(Dir=-10).best() == 5
    assert learnt(Dir=10).best() == -9
    assert "unvisited=Nearest(" in repr(form)


def test_the_scale_says_which_difference_counts() -> None:
    def learn(scale: float) -> int:
        form = Gaussian(unvisited=Nearest(scale={"Prox": scale}))
        specification = Specification({P(Dir): Uniform(), P(Prox): Uniform(), P(Vrot | Dir, Prox): form})
        data = {"Dir": [0, 4], "Prox": [6, 0], "Vrot": [7, -7]}
        drawn: int = specification.identify(data).ask(P(Vrot | Dir, Prox))(Dir=0, Prox=0).best()
        return drawn

    assert learn(1) == -7
    assert learn(0.5) == 7


def test_a_prior_answers_where_nothing_was_seen_and_yields_to_samples() -> None:
    form = Gaussian(unvisited=Prior(mean=2, deviation=3, strength=1))
    learnt = turning(form).identify({"Dir": [5] * 3, "Vrot": [6] * 3}).ask(P(Vrot | Dir))
    np.testing.assert_allclose(learnt(Dir=0).p, normal(2, 3), rtol=1e-12)
    # Four values, 2 +- 3 and thrice 6: mean 5, variance (9 + 9)/4 + 3/4.
    np.testing.assert_allclose(learnt(Dir=5).p, normal(5, np.sqrt(3 + 9 / 4)), rtol=1e-12)
    never = turning(form).identify().ask(P(Vrot | Dir))
    np.testing.assert_allclose(never(Dir=5).p, normal(2, 3), rtol=1e-12)


def test_uniform_where_nothing_was_seen() -> None:
    learnt = turning(Gaussian(unvisited="uniform")).identify({"Dir": [5], "Vrot": [6]}).ask(P(Vrot | Dir))
    np.testing.assert_allclose(learnt(Dir=0).p, np.full(21, 1 / 21), rtol=1e-12)
    np.testing.assert_allclose(learnt(Dir=5).p, normal(6, 0.7), rtol=1e-12)


def test_a_free_form_without_data_is_refused_when_it_is_needed_only() -> None:
    description = turning(Gaussian()).identify()
    with pytest.raises(Unidentified, match=r"P\(Vrot | Dir\)"):
        description.ask(P(Vrot | Dir))
    assert description.ask(P(Dir))().entropy() == pytest.approx(np.log2(21))


def test_a_mean_far_from_every_value_still_leaves_a_distribution() -> None:
    question = turning(Gaussian(mean=400, deviation=0.5)).identify().ask(P(Vrot | Dir))
    assert question(Dir=0).best() == 10
    assert question(Dir=0).p.sum() == pytest.approx(1)


def test_a_case_of_a_switch_is_identified_by_the_samples_of_its_case() -> None:
    specification = Specification(
        {P(H): Uniform(), P(Vrot | H): Switch(H, {"avoidance": Gaussian(), "phototaxy": Gaussian(0, 2)})}
    )
    learnt = specification.identify({"H": ["avoidance", "phototaxy", "avoidance"], "Vrot": [3, 9, 7]})
    question = learnt.ask(P(Vrot | H))
    np.testing.assert_allclose(question(H="avoidance").p, normal(5, 2), rtol=1e-12)
    np.testing.assert_allclose(question(H="phototaxy").p, normal(0, 2), rtol=1e-12)


def test_a_sigmoid_keeps_both_its_tails() -> None:
    specification = Specification({P(Dir): Uniform(), P(H | Dir): Sigmoid("avoidance", alpha=0, beta=20)})
    question = specification.identify().ask(P(H | Dir))
    assert question(Dir=8)["phototaxy"] == pytest.approx(np.exp(-640), rel=1e-9)
    assert question(Dir=-8)["avoidance"] == pytest.approx(np.exp(-640), rel=1e-9)
    assert question(Dir=0)["avoidance"] == pytest.approx(0.5)


def test_tables_as_array_mapping_and_function_say_the_same() -> None:
    Day = Variable("Day", ("dry", "wet"))
    array = [[0.9, 0.4], [0.1, 0.6]]
    mapping = {"dry": {"avoidance": 0.9, "phototaxy": 0.1}, "wet": (0.4, 0.6)}

    def function(H: str, Day: str) -> float:
        return array[("avoidance", "phototaxy").index(H)][("dry", "wet").index(Day)]

    answers = [
        Specification({P(Day): Table({"dry": 1 / 3, "wet": 2 / 3}), P(H | Day): Table(table)})
        .identify()
        .ask(P(Day | H))
        for table in (array, mapping, function)
    ]
    for question in answers:
        np.testing.assert_allclose(
            question(H="avoidance").p, np.array([0.3, 0.8 / 3]) / (0.3 + 0.8 / 3), rtol=1e-12
        )


def test_a_dirac_is_a_function() -> None:
    specification = Specification(
        {P(Dir): Uniform(), P(Prox): Uniform(), P(Vrot | Dir, Prox): Dirac(lambda Dir: -Dir)}, name="pi"
    )
    assert specification.identify().ask(P(Vrot | Dir, Prox))(Dir=4, Prox=2)[-4] == 1
    assert specification.identify().ask(P(Dir | Vrot))(Vrot=7)[-7] == 1


@pytest.mark.parametrize(
    ("forms", "sentence"),
    [
        (
            {P(Dir): Uniform(), P(Dir | Prox): Uniform()},
            r"Dir is left of the bar in both P\(Dir\) and P\(Dir \| Prox\)",
        ),
        ({P(Dir | Prox): Uniform()}, r"Prox in P\(Dir \| Prox\) is left of no bar; add P\(Prox\)"),
        (
            {P(Dir | Prox): Uniform(), P(Prox | Dir): Uniform()},
            r"P\(Dir \| Prox\) needs P\(Prox \| Dir\) needs .*a cycle",
        ),
        ({}, "has no terms"),
        ({P(H): Gaussian()}, r"one numeric variable left of the bar, and not for P\(H\)"),
        ({P(Dir): Sigmoid("avoidance", alpha=1, beta=1)}, "a Sigmoid is"),
        ({P(H): Table([0.5, 0.6])}, r"the table of P\(H\) sums to 1.1, and must sum to 1"),
        ({P(H): Table([1.0])}, r"the table of P\(H\) has the shape \(1,\), and its variables want \(2,\)"),
        ({P(H): Table([1.5, -0.5])}, "no probability"),
        ({P(Dir): Uniform(), P(H | Dir): Table({0: (0.5, 0.5)})}, "says nothing for Dir = -10"),
        ({P(Dir): Uniform(), P(H | Dir): Table({0: (0.5, 0.6)})}, "sums to|says nothing"),
        (
            {P(Prox): Uniform(), P(Vrot | Prox): Gaussian(lambda Dir: Dir, 1)},
            "the mean of .* is a function of 'Dir'",
        ),
        ({P(Prox): Uniform(), P(Vrot | Prox): Gaussian(0, 0)}, "a deviation that is not above 0"),
        ({P(Prox): Uniform(), P(Vrot | Prox): Switch(H, dict.fromkeys(H.values, Uniform()))}, "switches on H"),
        ({P(Dir): Uniform(), P(Variable("Dir", range(3))): Uniform()}, "two different variables named Dir"),
        ({P(Dir): 0.5}, "wants a term and its form"),
    ],
)
def test_a_specification_that_is_none_is_refused_with_a_sentence(
    forms: dict[object, object], sentence: str
) -> None:
    with pytest.raises(SpecificationError, match=sentence):
        Specification(forms, name="pi-wrong")  # type: ignore[arg-type]  # the slips are the point


def test_a_switch_must_have_one_case_for_every_value() -> None:
    with pytest.raises(SpecificationError, match="no case for phototaxy"):
        Switch(H, {"avoidance": Uniform()})
    with pytest.raises(SpecificationError, match="two cases for avoidance"):
        Switch(H, {"avoidance": Uniform(), ("avoidance", "phototaxy"): Uniform()})
    with pytest.raises(NotAValue, match="H = 'sleep'"):
        Switch(H, {"avoidance": Uniform(), "phototaxy": Uniform(), "sleep": Uniform()})


def test_data_that_do_not_fit_are_refused() -> None:
    specification = turning(Gaussian())
    with pytest.raises(DataError, match="no column for Vrot"):
        specification.identify({"Dir": [1]})
    with pytest.raises(DataError, match="datum 1 has no Vrot"):
        specification.identify([{"Dir": 1, "Vrot": 2}, {"Dir": 1}])
    with pytest.raises(DataError, match="different lengths"):
        specification.identify({"Dir": [1, 2], "Vrot": [3]})
    with pytest.raises(NotAValue, match="Vrot = 11"):
        specification.identify({"Dir": [1], "Vrot": [11]})
    with pytest.raises(SpecificationError, match=r"P\(Dir\) of pi-turn has no free parameters"):
        specification.identify(parameters={P(Dir): Uniform()})
    with pytest.raises(SpecificationError, match="both its mean and its deviation"):
        Gaussian(mean=0)
