"""Section 11.1's two extremes. A complete model is made of Diracs, and logic is what remains; one that has learnt
nothing is flat, and every decision is a random one.
"""

from itertools import product

from brp import Description, Dirac, Distribution, Histogram, Laplace, P, Specification, Uniform, Variable

# On an island live knights, who say only what is true, and knaves, who say only what is not. A says: all three of
# us are knaves. B says: exactly one of us is a knight. A variable is true for a knight; a claim is true when it is
# one that its owner would make.
A, B, C = (Variable(name, (False, True)) for name in "ABC")
A_says_all_are_knaves = Variable("A_says_all_are_knaves", (False, True))
B_says_one_is_a_knight = Variable("B_says_one_is_a_knight", (False, True))

island = Specification(
    {
        P(A): Uniform(),
        P(B): Uniform(),
        P(C): Uniform(),
        P(A_says_all_are_knaves | A, B, C): Dirac(lambda A, B, C: (A + B + C == 0) == A),
        P(B_says_one_is_a_knight | A, B, C): Dirac(lambda A, B, C: (A + B + C == 1) == B),
    },
    name="pi-island",
).identify()


def who() -> Distribution:
    """P(A B C | what was said)."""
    question = island.ask(P(A, B, C | A_says_all_are_knaves, B_says_one_is_a_knight))
    return question(A_says_all_are_knaves=True, B_says_one_is_a_knight=True)


# The same from data: a formal phenomenon without hidden variables, here an adder of two bits.
X, Y, Sum, Carry = (Variable(name, (0, 1)) for name in ("X", "Y", "Sum", "Carry"))


def adder(formal: bool) -> Description:
    """Identified from all that can happen; or by laws that have observed nothing."""
    form = Histogram if formal else Laplace
    pi_adder = Specification({P(X): form(), P(Y): form(), P(Sum | X, Y): form(), P(Carry | X, Y): form()})
    happens = [{"X": x, "Y": y, "Sum": (x + y) % 2, "Carry": (x + y) // 2} for x, y in product((0, 1), repeat=2)]
    return pi_adder.identify(happens if formal else [])


def main() -> None:
    """Logic, and noise."""
    print("who is a knight?", who())
    backwards = adder(formal=True).ask(P(Y | X, Sum))
    print("0 + Y gives 1:", backwards(X=0, Sum=1))
    print("learnt nothing:", adder(formal=False).ask(P(Y | X, Sum))(X=0, Sum=1))


if __name__ == "__main__":
    main()
