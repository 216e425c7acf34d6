"""A Bayesian subroutine (section 6, lesson 4): a question to one description is a form of another."""

from brp import P, Question, Specification, Table, Uniform, Variable

Season = Variable("Season", ("winter", "summer"))
Pressure = Variable("Pressure", ("falling", "steady", "rising"))
Clouds = Variable("Clouds", range(9))  # eighths of the sky
Rain = Variable("Rain", (False, True))

# One program knows the sky: Rain is the cause of Clouds and Pressure.
sky = Specification(
    {
        P(Season): Uniform(),
        P(Rain | Season): Table({"winter": [0.6, 0.4], "summer": [0.8, 0.2]}),
        P(Clouds | Rain): Table(
            {False: [0.2, 0.2, 0.15, 0.1, 0.1, 0.1, 0.05, 0.05, 0.05], True: [0] * 5 + [0.25] * 4}
        ),
        P(Pressure | Rain): Table({False: [0.2, 0.4, 0.4], True: [0.6, 0.3, 0.1]}),
    },
    name="pi-sky",
).identify()
forecast = sky.ask(P(Rain | Clouds, Pressure, Season))

# Another decides about an umbrella, and only calls it. What it says of Umbrella is no evidence about Rain.
Window = Variable("Window", range(9))  # the clouds that one sees from the window
Umbrella = Variable("Umbrella", ("leave", "take"))
going_out = Specification(
    {
        P(Season): Uniform(),
        P(Window): Uniform(),
        P(Pressure): Uniform(),
        P(Rain | Window, Pressure, Season): forecast.renamed({Clouds: Window}),
        P(Umbrella | Rain): Table({False: {"leave": 0.9, "take": 0.1}, True: {"take": 1}}),
    },
    name="pi-going-out",
).identify()
umbrella: Question = going_out.ask(P(Umbrella | Window, Pressure, Season))


def main() -> None:
    """The same window, two seasons; then who calls whom."""
    for season in Season.values:
        print(season, umbrella(Window=6, Pressure="falling", Season=season))
    print(umbrella)


if __name__ == "__main__":
    main()
