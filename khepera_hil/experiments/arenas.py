"""Arenas of the experiments' own, as TOML files: a thing somewhere and the robot beside it."""

from __future__ import annotations

import math
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from khepera_hil.teaching.view import BODY, nearest_point
from khepera_hil.world import World

__all__ = ["OBJECTS", "beside", "lamp_somewhere", "pocket", "pushable", "written"]

_SIZE = 1000.0  # mm


def _objects() -> dict[str, dict[str, Any]]:
    text = files("khepera_hil.world").joinpath("worlds", "objects.toml").read_text("utf-8")
    return {thing["name"]: thing for thing in tomllib.loads(text)["object"]}


OBJECTS: Mapping[str, Mapping[str, Any]] = _objects()
"""The fifteen objects of the arena ``objects``, as its file has them."""


@contextmanager
def written(text: str) -> Iterator[str]:
    """A file with this arena, as long as it is needed; its path."""
    with tempfile.TemporaryDirectory(prefix="khepera-hil-") as folder:
        path = Path(folder) / "arena.toml"
        path.write_text(text, "utf-8")
        yield str(path)


def toml(values: Mapping[str, Any]) -> str:
    """Keys and values as TOML's lines."""

    def value(one: Any) -> str:
        return f'"{one}"' if isinstance(one, str) else str(list(one) if isinstance(one, (list, tuple)) else one)

    return "".join(f"{key} = {value(one)}\n" for key, one in values.items())


def beside(thing: Mapping[str, Any], side: int, chance: np.random.Generator) -> str:
    """A thing in the middle, turned anyhow, and the robot 20 to 32 mm beside it; with ``side`` 1 at its right."""
    turned = 0.0 if thing["shape"] == "disc" else float(chance.uniform(-180, 180))
    placed = {**thing, "at_mm": [_SIZE / 2, _SIZE / 2]} | (
        {} if thing["shape"] == "disc" else {"angle_deg": turned}
    )
    head = f'title = "{thing["name"]}"\nsize_mm = [{_SIZE:g}, {_SIZE:g}]\n[[object]]\n{toml(placed)}'
    around, gap = float(chance.uniform(-math.pi, math.pi)), float(chance.uniform(20, 32)) / 1000
    with written(f"{head}[start]\nat_mm = [60, 60]\n") as path:
        shape = next(shape for shape in World(path, 0).shapes() if shape["name"] == thing["name"])
    pose = tuple(shape["pose"])
    low, high = 0.0, 0.45
    for _ in range(40):
        middle = (low + high) / 2
        x, y = pose[0] + middle * math.cos(around), pose[1] + middle * math.sin(around)
        px, py = nearest_point(shape, pose, (x, y, 0.0))
        room = math.hypot(px - x, py - y) - BODY - (0.0 if "polygon" in shape else shape["radius"])
        inside = middle < 0.02
        low, high = (middle, high) if inside or room < gap else (low, middle)
    x, y = pose[0] + high * math.cos(around), pose[1] + high * math.sin(around)
    px, py = nearest_point(shape, pose, (x, y, 0.0))
    towards = math.atan2(py - y, px - x)
    # With the thing at the right the robot looks a quarter to the left of it.
    heading = math.degrees(towards + side * math.pi / 2)
    heading = (heading + 180) % 360 - 180
    return f"{head}[start]\nat_mm = [{1000 * x:.2f}, {1000 * y:.2f}]\nheading_deg = {heading:.2f}\n"


def pushable(thing: Mapping[str, Any], chance: np.random.Generator) -> str:
    """A thing with room behind it, and the robot 15 to 35 mm before it, which looks up to 30 degrees past it."""
    x, y = chance.uniform(350, 650, 2)
    heading = math.atan2(500 - y, 500 - x) + chance.uniform(-0.6, 0.6)
    gap, off = chance.uniform(15, 35), math.radians(chance.uniform(-30, 30))
    turned = {} if thing["shape"] == "disc" else {"angle_deg": round(float(chance.uniform(-180, 180)), 2)}
    reach = _reach(thing)
    away = 28.5 + gap + reach
    start = [round(float(x - away * math.cos(heading)), 2), round(float(y - away * math.sin(heading)), 2)]
    looks = (math.degrees(heading + off) + 180) % 360 - 180
    placed = {"name": "object", **thing, "at_mm": [round(float(x), 2), round(float(y), 2)], **turned}
    return (
        f'title = "something to push"\nsize_mm = [{_SIZE:g}, {_SIZE:g}]\n[[object]]\n{toml(placed)}'
        f"[start]\nat_mm = {start}\nheading_deg = {looks:.2f}\n"
    )


def _reach(thing: Mapping[str, Any]) -> float:
    if "radius_mm" in thing:
        return float(thing["radius_mm"])
    if "size_mm" in thing:
        return math.hypot(*thing["size_mm"]) / 2
    return float(thing["side_mm"]) if thing["shape"] == "hexagon" else float(thing["side_mm"]) / math.sqrt(3)


def lamp_somewhere(chance: np.random.Generator, intensity: float = 7.0) -> tuple[str, tuple[float, float]]:
    """A bare floor, a lamp above it, the robot 200 mm away from it or more; the arena and the lamp's place (m)."""
    x, y = chance.uniform(150, 850, 2)
    height = chance.uniform(50, 100)
    while True:
        at = chance.uniform(60, 940, 2)
        if math.hypot(at[0] - x, at[1] - y) >= 200:
            break
    heading = chance.uniform(-180, 180)
    text = (
        f'title = "a lamp"\n[[lamp]]\nname = "lamp"\nat_mm = [{x:.2f}, {y:.2f}]\nheight_mm = {height:.2f}\n'
        f"intensity = {intensity:g}\nradius_mm = 5\n[start]\nat_mm = [{at[0]:.2f}, {at[1]:.2f}]\n"
        f"heading_deg = {heading:.2f}\n"
    )
    return text, (float(x) / 1000, float(y) / 1000)


def pocket(inner: float, deep: float, height: float, chance: np.random.Generator) -> str:
    """A base in a corner, half a metre before it a pocket open away from the light, the robot behind that."""
    wall, middle, turn = 16.0, 90 + 500 / math.sqrt(2), math.pi / 4
    parts = (
        ("bottom", wall, inner + 2 * wall, -wall / 2, 0.0),
        ("side 1", deep, wall, deep / 2, (inner + wall) / 2),
        ("side 2", deep, wall, deep / 2, -(inner + wall) / 2),
    )
    text = (
        'title = "a pocket before the base"\n[base]\ncorner = "south-west"\nside_mm = 180\nwall_length_mm = 95\n'
        'wall_height_mm = 60\nwall_thickness_mm = 10\ndiffuse = 0.6\n[[lamp]]\nname = "base lamp"\n'
        f"at_mm = [90, 90]\nheight_mm = {chance.uniform(65, 90):.2f}\nintensity = 7\nradius_mm = 5\n"
    )
    for name, long, wide, along, across in parts:
        x = middle + along * math.cos(turn) - across * math.sin(turn)
        y = middle + along * math.sin(turn) + across * math.cos(turn)
        text += (
            f'[[wall]]\nname = "{name}"\nat_mm = [{x:.2f}, {y:.2f}]\nangle_deg = 45\n'
            f"size_mm = [{long:g}, {wide:g}]\nheight_mm = {height:g}\n"
        )
    away = deep + chance.uniform(60, 160)
    x, y = middle + away * math.cos(turn), middle + away * math.sin(turn)
    heading = chance.uniform(-180, 180)
    return f"{text}[start]\nat_mm = [{min(x, 940):.2f}, {min(y, 940):.2f}]\nheading_deg = {heading:.2f}\n"
