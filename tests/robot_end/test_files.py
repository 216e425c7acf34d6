"""Arena and scenario files that somebody has damaged: a sentence, or a world that runs."""

import json
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from khepera_hil.errors import WorldError
from khepera_hil.world import World, arenas, load_arena, load_scenario, scenarios

PACKAGE = files("khepera_hil.world")
TEXT = st.text(alphabet='ab /.-1\n"é', max_size=4)
JUNK = st.one_of(
    st.integers(-(10**12), 10**12),
    st.floats(allow_nan=True, allow_infinity=True),
    st.booleans(),
    TEXT,
    st.lists(st.one_of(st.integers(-5, 2000), st.floats(), TEXT), max_size=4),
    st.builds(dict),
    st.builds(lambda: [{}]),
)


def written(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {written(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    if isinstance(value, float):
        text = repr(value)
        return text if "." in text or "n" in text else text.replace("e", ".0e")
    return json.dumps(value)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where there is something to damage."""
    found = [path] if path else []
    items: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        found += places(item, (*path, key))
    return found


def damaged(table: dict[str, Any], data: st.DataObject) -> dict[str, Any]:
    for _ in range(data.draw(st.integers(1, 2))):
        *way, last = data.draw(st.sampled_from(places(table) or [("title",)]))
        there: Any = table
        for key in way:
            there = there[key]
        if data.draw(st.booleans()):
            there[last] = data.draw(JUNK)
        elif last in there or isinstance(there, list):
            del there[last]
    return table


@pytest.mark.parametrize("name", [*arenas(), *scenarios()])
@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_file_is_refused_with_its_name_or_makes_a_world(
    name: str, tmp_path: Path, data: st.DataObject
) -> None:
    folder = "worlds" if name in arenas() else "scenarios"
    table = damaged(tomllib.loads(PACKAGE.joinpath(folder, f"{name}.toml").read_text("utf-8")), data)
    path = tmp_path / "mine.toml"
    path.write_text("".join(f"{json.dumps(key)} = {written(value)}\n" for key, value in table.items()), "utf-8")
    tomllib.loads(path.read_text("utf-8"))  # what was written is TOML
    complaint = None
    try:
        if folder == "worlds":
            world = World(load_arena(str(path)), 1)
        else:
            scenario = load_scenario(str(path))
            world = World(scenario.world or "furnished", 1, scenario)
    except WorldError as error:
        complaint = str(error)
    if complaint is not None:
        assert "mine" in complaint or "no arena" in complaint or "cannot be read" in complaint
        assert "\n" not in complaint
        return
    world.set_speed(50, 60)
    world.advance(0.3)
    json.dumps([world.proximity(), world.light(), world.camera(), world.shapes(), world.poses(), world.score()])
