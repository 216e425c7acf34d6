"""Learning one datum at a time (section 8): each experience makes the next description, and the old one stays."""

import numpy as np

from brp.programs.object import Lrl, Nlt, Nrt, O, Per, recognised, unacquainted
from brp.variables import P

OBJECTS = {
    "square": {"Nlt": 0, "Nrt": 4, "Per": 518, "Lrl": 20},
    "long box": {"Nlt": 0, "Nrt": 4, "Per": 718, "Lrl": 90},
    "corner": {"Nlt": 1, "Nrt": 5, "Per": 790, "Lrl": 47},
}


def tour(name: str, rng: np.random.Generator) -> dict[str, int]:
    """What going around an object reads, which "is quite choppy"."""
    read = dict(OBJECTS[name])
    read["Per"] += round(rng.normal(0, 4))
    read["Lrl"] += round(rng.normal(0, 6))
    return read


def main() -> None:
    """Present three objects, each several times: do you know this object, or is it a new one?"""
    rng = np.random.default_rng(3)
    knowing = unacquainted
    for name in rng.permutation(np.repeat(list(OBJECTS), 4)).tolist():
        read = tour(name, rng)
        answer = knowing.ask(P(O | Nlt, Nrt, Per, Lrl))(**read)
        o = recognised(knowing, read)
        print(f"{name:8} {'new' if answer.best() == 0 else 'known'}: class {o}, P(O = 0) = {answer[0]:.3g}")
        knowing = knowing.learn(read | {"O": o})


if __name__ == "__main__":
    main()
