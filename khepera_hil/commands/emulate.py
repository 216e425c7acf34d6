"""``khepera-hil emulate``: the robot's end alone, behind a pseudo-terminal, for any program that drives a Khepera."""
