"""Filters, held against a hidden Markov model's forward pass and a Kalman filter."""

from __future__ import annotations

import numpy as np
import pytest

from brp import (
    Distribution,
    Gaussian,
    ImpossibleEvidence,
    P,
    QuestionError,
    Specification,
    SpecificationError,
    Table,
    Uniform,
    Variable,
)
from brp.filter import Filter, Particles

Before = Variable("X_t-1", range(5))
Now = Variable("X_t", range(5))
Seen = Variable("Z", range(4))
Turned = Variable("U", range(2))

rng = np.random.default_rng(1)
FIRST = rng.dirichlet(np.ones(5))
MOVE = rng.dirichlet(np.ones(5), size=(2, 5)).transpose(2, 1, 0)  # now, before, turned
SEE = rng.dirichlet(np.full(4, 0.4), size=5).T

markov = Specification(
    {
        P(Before): Table(FIRST),
        P(Turned): Uniform(),
        P(Now | Before, Turned): Table(MOVE),
        P(Seen | Now): Table(SEE),
    },
    name="pi-markov",
).identify()


def forward(belief: np.ndarray, turned: int, seen: int) -> np.ndarray:
    after = MOVE[:, :, turned] @ belief * SEE[seen]
    return np.asarray(after / after.sum())


def test_the_filter_is_a_hidden_markov_models_forward_pass() -> None:
    track = Filter(markov, {Now: Before}, known=(Seen, Turned))
    belief, expected = track.start, FIRST
    random = np.random.default_rng(2)
    for _ in range(2000):
        turned, seen = int(random.integers(2)), int(random.integers(4))
        belief, expected = track.step(belief, Z=seen, U=turned), forward(expected, turned, seen)
        np.testing.assert_allclose(belief.p, expected, rtol=1e-12)
    assert belief.variables == (Now,)


def test_a_drawn_value_is_followed_as_one_that_is_known() -> None:
    track = Filter(markov, {Now: Before}, known=(Seen, Turned))
    for value in Now.values:
        expected = markov.ask(P(Now | Before, Seen, Turned))(X_t_1=value, Z=2, U=1)
        np.testing.assert_allclose(track.follow(value, Z=2, U=1).p, expected.p, rtol=1e-12)


def test_the_belief_takes_the_place_of_the_prior_before_what_is_known_is_weighed() -> None:
    """Mixing the normalised rows by the belief is something else (section 9 read as a filter)."""
    track = Filter(markov, {Now: Before}, known=(Seen, Turned))
    belief = Distribution((Now,), np.array([0.5, 0, 0, 0.5, 0]))
    rows = np.array([markov.ask(P(Now | Before, Seen, Turned))(X_t_1=x, Z=2, U=1).p for x in Now.values])
    answer = track.step(belief, Z=2, U=1).p
    np.testing.assert_allclose(answer, forward(belief.p, 1, 2), rtol=1e-12)
    assert np.abs(answer - belief.p @ rows).max() > 0.01


def test_a_conjunction_is_carried_whole() -> None:
    A, B = Variable("A", range(3)), Variable("B", range(2))
    A1, B1 = Variable("A_t-1", range(3)), Variable("B_t-1", range(2))
    random = np.random.default_rng(3)
    joint = random.dirichlet(np.ones(6), size=(3, 2)).transpose(2, 0, 1).reshape(3, 2, 3, 2)
    see = random.dirichlet(np.ones(4), size=(3, 2)).transpose(2, 0, 1)
    both = Specification(
        {P(A1): Uniform(), P(B1 | A1): Uniform(), P(A, B | A1, B1): Table(joint), P(Seen | A, B): Table(see)}
    ).identify()
    track = Filter(both, {A: A1, B: B1}, known=(Seen,))
    belief, expected = track.start, np.full((3, 2), 1 / 6)
    for seen in (0, 3, 1, 1, 2):
        belief = track.step(belief, Z=seen)
        expected = np.einsum("abcd,cd->ab", joint, expected) * see[seen]
        expected /= expected.sum()
        np.testing.assert_allclose(belief.p, expected, rtol=1e-12)
    value = belief.best()
    assert track.follow(value, Z=1).variables == (A, B)


def test_what_is_unlikely_after_the_belief_is_not_impossible() -> None:
    """A sensor of deviation 1 that reads 60 away from everything that was believed: exp(-1800)."""
    X1, X, Z = (Variable(name, range(101)) for name in ("X_t-1", "X", "Z"))
    still = Specification(
        {P(X1): Uniform(), P(X | X1): Table(np.eye(101)), P(Z | X): Gaussian(lambda X: X, 1)}
    ).identify()
    track = Filter(still, {X: X1}, known=(Z,))
    p = np.zeros(101)
    p[[10, 11]] = 0.5
    after = track.step(Distribution((X,), p), Z=71)
    assert after[11] == pytest.approx(1 / (1 + np.exp(-(61**2 - 60**2) / 2)))
    assert after.p.sum() == pytest.approx(1)
    jump = Specification({P(X1): Uniform(), P(X | X1): Table(np.eye(101)), P(Z | X): Table(np.eye(101))}).identify()
    with pytest.raises(ImpossibleEvidence, match="Z = 71 is impossible after what was believed about X"):
        Filter(jump, {X: X1}, known=(Z,)).step(Distribution((X,), p), Z=71)


X1, X, Z = (Variable(name, range(-200, 201)) for name in ("X_t-1", "X", "Z"))
GAIN, DRIFT, NOISE, SPREAD = 0.95, 8.0, 15.0, 20.0
linear = Specification(
    {
        P(X1): Gaussian(0, SPREAD),
        P(X | X1): Gaussian(lambda X_t_1: GAIN * X_t_1, DRIFT),
        P(Z | X): Gaussian(lambda X: X, NOISE),
    }
).identify()


def kalman(readings: list[int]) -> list[tuple[float, float]]:
    mean, variance, found = 0.0, SPREAD**2, []
    for z in readings:
        mean, variance = GAIN * mean, GAIN**2 * variance + DRIFT**2
        gain = variance / (variance + NOISE**2)
        mean, variance = mean + gain * (z - mean), (1 - gain) * variance
        found.append((mean, variance))
    return found


def readings(steps: int) -> list[int]:
    random = np.random.default_rng(4)
    x, seen = 0.0, []
    for _ in range(steps):
        x = GAIN * x + random.normal(0, DRIFT)
        seen.append(round(x + random.normal(0, NOISE)))
    return seen


def test_on_a_linear_gaussian_case_the_filter_is_a_kalman_filter() -> None:
    """Steps of 1 are small beside the deviations, and the ends far away: mean and variance agree to 1e-6."""
    track = Filter(linear, {X: X1}, known=(Z,))
    belief, seen = track.start, readings(100)
    for z, (mean, variance) in zip(seen, kalman(seen), strict=True):
        belief = track.step(belief, Z=z)
        assert belief.mean() == pytest.approx(mean, abs=1e-6)
        assert belief.p @ (X.numbers - belief.mean()) ** 2 == pytest.approx(variance, rel=1e-6)


def test_particles_are_the_exact_filter_within_the_error_that_they_state() -> None:
    exact, cloudy = Filter(linear, {X: X1}, known=(Z,)), Particles(linear, {X: X1}, known=(Z,), count=4000)
    random = np.random.default_rng(5)
    belief, cloud = exact.start, cloudy.start(random)
    inside = []
    for z in readings(60):
        belief, cloud = exact.step(belief, Z=z), cloudy.step(cloud, random, Z=z)
        mean, error = cloud.mean(X)
        inside.append(abs(mean - belief.mean()) < 3 * error)
        p, errors = cloud.distribution(X)
        assert np.abs(p.p - belief.p).max() < 6 * errors.max()
    assert np.mean(inside) > 0.95
    assert 1 <= cloud.effective <= 4000


def test_particles_of_a_discrete_model_follow_its_forward_pass() -> None:
    cloudy = Particles(markov, {Now: Before}, known=(Seen, Turned), count=20_000)
    random = np.random.default_rng(6)
    cloud, expected = cloudy.start(random), FIRST
    for step in range(20):
        turned, seen = step % 2, int(random.integers(4))
        cloud, expected = cloudy.step(cloud, random, Z=seen, U=turned), forward(expected, turned, seen)
        np.testing.assert_allclose(cloud.distribution(Now)[0].p, expected, atol=0.03)


def test_a_filter_that_cannot_be_is_refused_with_a_sentence() -> None:
    with pytest.raises(QuestionError, match="X_t cannot become Z: their values differ"):
        Filter(markov, {Now: Seen})
    with pytest.raises(QuestionError, match="at least one"):
        Filter(markov, {})
    with pytest.raises(QuestionError, match="has no variable W"):
        Filter(markov, {Now: Variable("W", range(5))})
    with pytest.raises(SpecificationError, match="X_t must have terms of their own"):
        Filter(markov, {Before: Now})
    with pytest.raises(QuestionError, match="carries a belief about X_t, and not <P\\(Z\\)"):
        Filter(markov, {Now: Before}, known=(Seen, Turned)).step(markov.ask(P(Seen))(), Z=1, U=1)
    with pytest.raises(QuestionError, match="which the particles neither carry nor are told"):
        Particles(markov, {Now: Before}, known=(Seen,))
    track, random = Particles(markov, {Now: Before}, known=(Seen, Turned), count=10), np.random.default_rng(0)
    cloud = track.start(random)
    with pytest.raises(QuestionError, match="must be told Z U"):
        track.step(cloud, random, Z=1)
