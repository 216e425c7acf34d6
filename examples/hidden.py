"""Learning with a variable that no data set holds (lesson 7): when does the driver of `if_then_else` brake?

P(H | Gap) is "specified or learned". Nobody sees H; the speeds tell which it probably was, and each round of EM
makes the next description of that.
"""

import numpy as np

from brp import Description, Laplace, P, Specification
from brp.em import identify_hidden
from examples.if_then_else import Gap, H, Limit, drive, driving

learning = Specification({**driving.specification.forms, P(H | Gap): Laplace()}, name="pi-learning")


def observed(rng: np.random.Generator, trips: int) -> list[dict[str, int]]:
    """Gaps, limits and speeds of somebody who drives as `if_then_else` says; H is not among them."""
    gaps, limits = rng.choice(list(Gap.values), trips).tolist(), rng.choice(list(Limit.values), trips).tolist()
    seen = [{"Gap": gap, "Limit": limit} for gap, limit in zip(gaps, limits, strict=True)]
    return [{**known, "Speed": drive(**known).draw(rng)} for known in seen]


def learnt(rng: np.random.Generator, trips: int = 3000) -> Description:
    """delta-trips and pi-learning."""
    return identify_hidden(learning, observed(rng, trips), name="delta-trips").description


def main() -> None:
    """What was learnt, beside the Sigmoid that the driver really has."""
    description = learnt(np.random.default_rng(5))
    found, real = description.ask(P(H | Gap)), driving.ask(P(H | Gap))
    print(found)
    for gap in range(0, 101, 10):
        print(f"Gap {gap:3}: brake {found(Gap=gap)['brake']:.2f}, really {real(Gap=gap)['brake']:.2f}")


if __name__ == "__main__":
    main()
