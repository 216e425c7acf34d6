"""Naive Bayes fusion (section 6): "knowing the cause, the consequences are independent"."""

from brp import Gaussian, P, Specification, Uniform, Variable

Temperature = Variable("Temperature", range(-10, 41))
Cellar, Door, Roof = (Variable(name, range(-20, 51)) for name in ("Cellar", "Door", "Roof"))

# Three thermometers that differ in how far they can be trusted; the one on the roof reads 3 degrees too much.
weather = Specification(
    {
        P(Temperature): Uniform(),
        P(Cellar | Temperature): Gaussian(lambda Temperature: 10 + 0.3 * (Temperature - 10), deviation=1),
        P(Door | Temperature): Gaussian(lambda Temperature: Temperature, deviation=3),
        P(Roof | Temperature): Gaussian(lambda Temperature: Temperature + 3, deviation=2),
    },
    name="pi-weather",
).identify()

fused = weather.ask(P(Temperature | Cellar, Door, Roof))
by_one = weather.ask(P(Temperature | Door))
expected = weather.ask(P(Roof | Cellar, Door))


def main() -> None:
    """The signal is heightened; a sensor that contradicts the others is found out."""
    print("the door alone:", by_one(Door=20))
    print("all three:     ", fused(Cellar=13, Door=20, Roof=24))
    print("is the roof's 24 likely, by the others?", f"{expected(Cellar=13, Door=20)[24]:.3g}")
    print("and would 45 be?                       ", f"{expected(Cellar=13, Door=20)[45]:.3g}")


if __name__ == "__main__":
    main()
