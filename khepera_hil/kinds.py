"""Of what kind the things in a run's files must be, looked at before anybody works with them.

Everything here raises one of ``WRONG`` for what is not as it must be; ``reading`` makes a sentence of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from khepera_hil.recording import Pose, Value

__all__ = ["FAR", "WRONG", "as_number", "as_pose", "as_uniform", "as_value", "check_manifest"]

WRONG = (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError)

FAR = 1e9
"""No time (s), delay (ms) or place (m) of a run is beyond this; the viewer's nanoseconds would overflow."""

LARGEST_VALUE = 1 << 53
"""No value of a variable is beyond this; columns and axes are float64 or int64."""


def check_manifest(manifest: Mapping[str, Any]) -> None:
    """Refuse a manifest in which something that its readers rely on is of another kind."""
    _need(isinstance(manifest.get("program", "?"), str), "the program has no name")
    _need(isinstance(manifest.get("run", ""), str), "the run has no name")
    seed = manifest.get("seed", 0)
    _need(type(seed) is int and 0 <= seed < 10**20, "the seed is no whole number")
    started = manifest.get("started")
    _need(started is None or datetime.fromisoformat(started).timestamp() >= 0, "the start is before 1970")
    _need(as_number(manifest.get("period_s", 0.1)) > 0, "the period is not above 0")
    host = manifest.get("host_columns") or []
    _need(isinstance(host, list) and all(isinstance(name, str) for name in host), "host_columns are no names")
    for name in ("ending", "versions", "robot", "evidence", "world"):
        _need(isinstance(manifest.get(name) or {}, dict), f"{name} is no object")
    _need(isinstance((manifest.get("ending") or {}).get("score") or {}, dict), "the score is no object")
    _need(isinstance(manifest.get("questions") or [], list), "the questions are no list")
    for question in manifest.get("questions") or []:
        _question(question)
    keys = [question["key"] for question in manifest.get("questions") or []]
    _need(len(set(keys)) == len(keys), "two questions have one key")
    for name, domain in (manifest.get("evidence") or {}).items():
        _domain(name, domain)
    if manifest.get("world") is not None:
        _world(manifest["world"])


def as_number(given: Any, beyond: float = FAR) -> float:
    """A finite number, and not beyond what a run may have."""
    if isinstance(given, bool) or not isinstance(given, (int, float)):
        raise TypeError(f"{given!r} is not a number")
    if not (math.isfinite(given) and abs(given) <= beyond):
        raise ValueError(f"{given!r} is out of range")
    return float(given)


def as_uniform(given: Any) -> float:
    """A number in [0, 1)."""
    found = as_number(given)
    if not 0 <= found < 1:
        raise ValueError(f"the uniform number {given!r} is not in [0, 1)")
    return found


def as_pose(given: Any) -> Pose:
    """Three numbers."""
    x, y, theta = given
    return as_number(x), as_number(y), as_number(theta)


def as_value(given: Any) -> Value:
    """A variable's value: a number, a truth or a word."""
    if isinstance(given, (str, bool)):
        return given
    found = as_number(given, LARGEST_VALUE)
    return given if isinstance(given, int) else found


def _question(question: Mapping[str, Any]) -> None:
    key, variables, values = question["key"], question["variables"], question["values"]
    _need(isinstance(key, str) and isinstance(question["name"], str), "a question has no name")
    _need(isinstance(question.get("description", ""), str), f"the description of question {key!r} has no name")
    _need(isinstance(variables, list) and isinstance(values, list), f"question {key!r} has no list of variables")
    _need(bool(variables), f"question {key!r} has no variables")
    for variable, domain in zip(variables, values, strict=True):
        _need(isinstance(variable, str), f"a variable of question {key!r} has no name")
        _domain(variable, domain)


def _domain(name: str, domain: Any) -> None:
    _need(isinstance(domain, list) and bool(domain), f"{name} has no values")
    # By their text, since true and 1 are two words but one number.
    _need(len({str(as_value(each)) for each in domain}) == len(domain), f"a value of {name} stands twice")


def _world(world: Mapping[str, Any]) -> None:
    width, depth = world["size"]
    _need(as_number(width) > 0 and as_number(depth) > 0, "the arena has no size")
    for shape in world["shapes"]:
        _need(isinstance(shape["name"], str) and isinstance(shape["kind"], str), "a shape has no name")
        as_pose(shape["pose"])
        as_number(shape.get("height", 0.0))
        if "radius" in shape:
            _need(as_number(shape["radius"]) > 0, "a shape has no size")
        else:
            corners = [(as_number(x), as_number(y)) for x, y in shape["polygon"]]
            _need(len(set(corners)) > 2, "a polygon has no three corners")


def _need(good: bool, otherwise: str) -> None:
    if not good:
        raise ValueError(otherwise)
