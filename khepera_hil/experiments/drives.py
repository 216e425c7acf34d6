"""How the experiments drive: by a program with some data, or by the teacher; and what is measured of each behavior.

A description is named by a short text: ``specified`` (the table written by hand), ``shipped`` (delta-avoid ...),
``nothing`` (no data at all), ``shuffled`` (the shipped data, Vrot dealt out anew), ``taught:SECONDS:SEED`` (a
lesson of its own), so that a case can say what it goes by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from brp import Description
from brp.data import shipped, shipped_file
from brp.store import load_data
from khepera_hil import chance
from khepera_hil.controllers import PROGRAMS, Controller, Setting
from khepera_hil.experiments.arenas import OBJECTS, beside, lamp_somewhere, pushable, written
from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.trial import Trial, drive
from khepera_hil.recording import Tick
from khepera_hil.teaching.lesson import BEHAVIORS, WORLDS, Lesson
from khepera_hil.teaching.scripted import Scripted

__all__ = [
    "BEHAVIOR_TRIALS",
    "avoid",
    "description",
    "follow",
    "generator",
    "lesson",
    "phototaxy",
    "program",
    "push",
]

THING = {"shape": "disc", "radius_mm": 25, "height_mm": 40, "mass_g": 40}


def generator(seed: int, *more: int) -> np.random.Generator:
    """An experiment's own chance for a case: what the arena's file leaves to be drawn."""
    return np.random.default_rng([seed, 71, *more])


def lesson(behavior: str, seconds: float, seed: int) -> list[dict[str, Any]]:
    """The data of a lesson by the scripted teacher."""
    taken: list[Lesson] = []

    def make(eyes: Any) -> Controller:
        taken.append(Lesson(behavior, Scripted(behavior, eyes, chance.generator(seed, "teacher"))))
        return taken[-1]

    drive(make, world=WORLDS[behavior], seed=seed, duration=seconds)
    return taken[0].rows


def description(behavior: str, by: str, *, data_of: str | None = None) -> Description | None:
    """What to go by; None for the table written by hand. ``data_of`` names another behavior's data."""
    source = data_of or behavior
    specification = BEHAVIORS[behavior].specification
    variables = BEHAVIORS[behavior].variables
    kind, *rest = by.split(":")
    if kind == "specified":
        return None
    if kind == "shipped":
        return shipped(f"delta-{source}", specification)
    if kind == "nothing":
        return specification.identify(
            {v.name: [] for v in variables},
            name="nothing",
            parameters={term: _flat() for term in specification.free},
        )
    if kind == "shuffled":
        _, columns = load_data(shipped_file(f"delta-{source}"), variables)
        columns["Vrot"] = np.random.default_rng(1).permutation(columns["Vrot"]).tolist()
        return specification.identify(columns, name=f"delta-{source} shuffled")
    seconds, seed = float(rest[0]), int(rest[1])
    rows = lesson(source, seconds, seed)
    return specification.identify([{v.name: row[v.name] for v in variables} for row in rows], name="a lesson")


def _flat() -> Any:
    """No data: every command is as good as another."""
    from brp import Uniform

    return Uniform()


def program(behavior: str, by: str, unknown: Sequence[str] = (), data_of: str | None = None) -> Controller:
    """The behavior's program, going by that."""
    return PROGRAMS[behavior].make(Setting(tuple(unknown), description(behavior, by, data_of=data_of)))


def _driver(case: Case, behavior: str) -> Controller | Callable[[Any], Controller]:
    if case["by"] == "teacher":

        def teach(eyes: Any) -> Controller:
            return Lesson(behavior, Scripted(behavior, eyes, chance.generator(case["seed"], "teacher")))

        return teach
    return program(behavior, case["by"], case.get("unknown", ()), case.get("data_of"))


def push(case: Case) -> Result:
    """How far a thing was pushed within 30 s of being touched; it ends at 200 mm."""
    thing = case.get("thing", THING)
    state: dict[str, float] = {"moved": 0.0}

    def watch(tick: Tick, trial: Trial) -> bool:
        began = next(shape["pose"] for shape in trial.shapes if shape["name"] == "object")
        now = trial.poses["object"]
        way = 1000 * math.hypot(now[0] - began[0], now[1] - began[1])
        state["moved"] = max(state["moved"], way)
        if way > 1 and "touched" not in state:
            state["touched"] = tick.t
        return state["moved"] >= 200 or ("touched" in state and tick.t - state["touched"] >= 30)

    with written(pushable(thing, generator(case["seed"]))) as world:
        trial = drive(_driver(case, "push"), world=world, seed=case["seed"], duration=45, watch=watch)
    return {"moved_mm": round(state["moved"], 2), "seconds": round(trial.ticks[-1].t, 3)}


def avoid(case: Case) -> Result:
    """Contacts and way in the furnished arena."""
    trial = drive(
        _driver(case, "avoid"), world=case.get("world", "furnished"), seed=case["seed"], duration=case["seconds"]
    )
    score = trial.score
    return {
        "long": score["contacts_over_half_second"],
        "longest_s": score["contact_longest_s"],
        "way_m": score["distance_m"],
        "seconds": case["seconds"],
    }


def follow(case: Case) -> Result:
    """Whether a tour around an object was completed: all the way round, and never far from it."""
    side = -1 if case["behavior"] == "follow-left" else 1
    thing = OBJECTS[case["object"]]
    state = {"turned": 0.0, "before": math.nan}

    def watch(tick: Tick, trial: Trial) -> bool:
        if tick.pose is None:
            return False
        x, y, _ = trial.poses[case["object"]]
        angle = math.atan2(tick.pose[1] - y, tick.pose[0] - x)
        if not math.isnan(state["before"]):
            state["turned"] += (angle - state["before"] + math.pi) % (2 * math.pi) - math.pi
        state["before"] = angle
        return abs(state["turned"]) >= 2 * math.pi or math.hypot(tick.pose[0] - x, tick.pose[1] - y) > 0.35

    with written(beside(thing, side, generator(case["seed"], len(case["object"])))) as world:
        trial = drive(_driver(case, case["behavior"]), world=world, seed=case["seed"], duration=120, watch=watch)
    return {
        "round": abs(state["turned"]) >= 2 * math.pi,
        "seconds": round(trial.ticks[-1].t, 3),
        "longest_s": trial.score["contact_longest_s"],
    }


def phototaxy(case: Case) -> Result:
    """Whether the lamp was reached (60 mm), and by how much more way than straight."""
    text, (x, y) = lamp_somewhere(generator(case["seed"]), case.get("intensity", 7.0))

    def watch(tick: Tick, trial: Trial) -> bool:
        return tick.pose is not None and math.hypot(tick.pose[0] - x, tick.pose[1] - y) <= 0.06

    with written(text) as world:
        trial = drive(_driver(case, "phototaxy"), world=world, seed=case["seed"], duration=120, watch=watch)
    first = trial.ticks[0].pose
    assert first is not None
    straight = math.hypot(first[0] - x, first[1] - y) - 0.06
    return {
        "reached": trial.stopped,
        "ratio": round(trial.path / straight, 4),
        "seconds": round(trial.ticks[-1].t, 3),
    }


BEHAVIOR_TRIALS: dict[str, Callable[[Case], Result]] = {
    "push": push,
    "avoid": avoid,
    "follow": follow,
    "follow-left": follow,
    "phototaxy": phototaxy,
}
