"""Pushing obstacles (section 5 of the paper): one description, taught by examples, and three questions to it."""

import numpy as np

from brp import Description, Gaussian, P, Specification, Uniform, Variable

Dir = Variable("Dir", range(-10, 11))  # where the obstacle is: left, ahead, right
Prox = Variable("Prox", range(16))  # how near it is
Vrot = Variable("Vrot", range(-10, 11))  # how fast to turn
obstacle = Specification(
    {P(Dir): Uniform(), P(Prox): Uniform(), P(Vrot | Dir, Prox): Gaussian()},
    name="pi-obstacle",
)


def taught(rng: np.random.Generator, ticks: int = 300) -> dict[str, np.ndarray[tuple[int], np.dtype[np.int64]]]:
    """What a joystick did: turn towards the obstacle, the more carelessly the farther it is."""
    seen, near = rng.integers(-10, 11, ticks), rng.integers(16, size=ticks)
    turned = np.clip(np.rint(rng.normal(seen, (18 - near) / 6)), -10, 10).astype(np.int64)
    return {"Dir": seen, "Prox": near, "Vrot": turned}


def learnt(rng: np.random.Generator) -> Description:
    """delta-push and pi-obstacle."""
    return obstacle.identify(taught(rng), name="delta-push")


def main() -> None:
    """Ask how to turn, how to turn when Prox has failed, and where the obstacle was when the robot turned so."""
    rng = np.random.default_rng(1)
    push = learnt(rng)

    turn = push.ask(P(Vrot | Dir, Prox))
    print(turn)
    print(turn(Dir=6, Prox=12), "drawn:", turn(Dir=6, Prox=12).draw(rng))

    half_blind = push.ask(P(Vrot | Dir))
    print(half_blind)
    print(half_blind(Dir=6))

    backwards = push.ask(P(Dir | Vrot, Prox))
    print(backwards)
    print(backwards(Vrot=6, Prox=12))


if __name__ == "__main__":
    main()
