"""Inverse programming (section 9): say what each activity lets one observe, and ask what to do."""

from brp import P, Specification, Table, Uniform, Variable

Activity = Variable("Activity", ("rest", "clean", "dock"))
Activity_t_1 = Variable("Activity_t-1", Activity.values)
Battery = Variable("Battery", ("low", "half", "full"))
Docked = Variable("Docked", (False, True))
Ordered = Variable("Ordered", (False, True))

x = "x"  # an equal share of what the column leaves
vacuum = Specification(
    {
        P(Activity_t_1): Uniform(),
        # A column for each of rest, clean, dock.
        P(Activity | Activity_t_1): Table([[0.9, 0, x], [0.1, 0.95, x], [0, x, 0.9]]),
        P(Battery | Activity): Table([[x, 0.02, 0.6], [x, x, x], [0.2, x, x]]),
        P(Docked | Activity): Table([[0, 0.98, 0.99], [1, x, x]]),
        P(Ordered | Activity): Table([[0.8, 0, 0.5], [0.2, 1, 0.5]]),
    },
    name="pi-vacuum",
).identify()

strict = vacuum.ask(P(Activity | Activity_t_1, Battery, Docked, Ordered))
# A vacuum cleaner at rest that is carried off its dock: pi-vacuum says nothing of that. Ask without Activity_t-1.
act = strict.where_impossible(without=Activity_t_1)


def main() -> None:
    """A day of it."""
    activity = "rest"
    for battery, docked, ordered in (
        ("full", True, False),
        ("full", True, True),
        ("half", False, True),
        ("low", False, True),
        ("low", False, False),
        ("half", True, False),
    ):
        known = {"Battery": battery, "Docked": docked, "Ordered": ordered, "Activity_t_1": activity}
        answer = act(**known)
        activity = answer.best()
        print(f"battery {battery:4} docked {docked!s:5} ordered {ordered!s:5} -> {answer}")
    carried = {"Battery": "half", "Docked": False, "Ordered": False, "Activity_t_1": "rest"}
    print("carried off its dock at rest, which is possible:", strict.possible(**carried), "->", act(**carried))


if __name__ == "__main__":
    main()
