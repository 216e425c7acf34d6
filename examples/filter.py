"""A Bayesian filter: where in a round corridor with four doors is a robot? The belief goes from step to step."""

import numpy as np

from brp import P, Specification, Table, Uniform, Variable
from brp.filter import Filter

LENGTH = 20
DOORS = frozenset({2, 5, 11, 12})

Place = Variable("Place", range(LENGTH))
Place_t_1 = Variable("Place_t-1", range(LENGTH))
Steps = Variable("Steps", (0, 1, 2))  # ordered; the wheels slip
Seen = Variable("Seen", ("wall", "door"))


def moved(Place: int, Place_t_1: int, Steps: int) -> float:
    """One step too few or too many, one time in twenty each, when it moves at all."""
    apart = (Place - Place_t_1 - Steps) % LENGTH
    if Steps == 0:
        return float(apart == 0)
    return {0: 0.9, 1: 0.05, LENGTH - 1: 0.05}.get(apart, 0.0)


corridor = Specification(
    {
        P(Place_t_1): Uniform(),
        P(Steps): Uniform(),
        P(Place | Place_t_1, Steps): Table(moved),
        P(Seen | Place): Table(
            {place: [0.05, 0.95] if place in DOORS else [0.98, 0.02] for place in range(LENGTH)}
        ),
    },
    name="pi-corridor",
).identify()

localise = Filter(corridor, {Place: Place_t_1}, known=(Steps, Seen))


def walked(rng: np.random.Generator, steps: int) -> list[tuple[int, str]]:
    """Where a robot that is ordered one step at a time really was, and what it saw there."""
    place, way = int(rng.integers(LENGTH)), []
    for _ in range(steps):
        place = corridor.ask(P(Place | Place_t_1, Steps))(Place_t_1=place, Steps=1).draw(rng)
        way.append((place, corridor.ask(P(Seen | Place))(Place=place).draw(rng)))
    return way


def main() -> None:
    """Lost at first, and found after some doors."""
    belief = localise.start
    for place, seen in walked(np.random.default_rng(4), 25):
        belief = localise.step(belief, Steps=1, Seen=seen)
        print(f"at {place:2}, saw a {seen}: probably at {belief.best():2}, {belief.entropy():.1f} bits of doubt")


if __name__ == "__main__":
    main()
