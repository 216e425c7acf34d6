"""A probabilistic if-then-else (section 7, lesson 7): a command variable that is summed out mixes two behaviors."""

from brp import Dirac, Gaussian, P, Sigmoid, Specification, Switch, Uniform, Variable

Gap = Variable("Gap", range(0, 101, 5))  # metres to the car ahead
Limit = Variable("Limit", range(30, 131, 10))  # km/h
H = Variable("H", ("brake", "cruise"))
Speed = Variable("Speed", range(0, 131, 5))

driving = Specification(
    {
        P(Gap): Uniform(),
        P(Limit): Uniform(),
        P(H | Gap): Sigmoid("cruise", alpha=40, beta=0.05),
        P(Speed | Gap, Limit, H): Switch(
            H,
            {
                "brake": Gaussian(lambda Gap: Gap, deviation=10),
                "cruise": Gaussian(lambda Limit: Limit, deviation=10),
            },
        ),
    },
    name="pi-driving",
).identify()

drive = driving.ask(P(Speed | Gap, Limit))  # H is not known: the mixture
braking = driving.ask(P(Speed | Gap, Limit, H))  # H is known: the usual branching
why = driving.ask(P(H | Gap, Limit, Speed))  # H is searched: what made it drive so?

# A condition that is certain makes the usual if-then-else of it.
hard = Specification(
    {
        **driving.specification.forms,
        P(H | Gap): Dirac(lambda Gap: "brake" if Gap < 40 else "cruise"),
    },
    name="pi-hard",
).identify()


def main() -> None:
    """From far away to near."""
    print(drive)
    for gap in (80, 45, 40, 35, 10):
        print(f"Gap {gap:2}:", drive(Gap=gap, Limit=100))
    print("why 60 km/h at a gap of 45?", why(Gap=45, Limit=100, Speed=60))
    print("with a hard condition:", hard.ask(P(Speed | Gap, Limit))(Gap=35, Limit=100))


if __name__ == "__main__":
    main()
