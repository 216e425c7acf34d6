"""A made-up run for these tests: a robot drives a circle in an arena with a few shapes, and the answers are
plain Gaussians. It looks like a run of the homing program to whoever records it; nothing in it is inferred."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from khepera_hil.recording import Answer, Tick

VROT: tuple[int | str, ...] = tuple(range(-10, 11))
H: tuple[int | str, ...] = ("avoidance", "phototaxy")

QUESTIONS = [
    ("Vrot", "P(Vrot | Dir Prox Theta1)", "Vrot", VROT, True),
    ("H", "P(H | Prox)", "H", H, False),
    ("Vrot avoidance", "P(Vrot | Dir Prox), avoidance", "Vrot", VROT, False),
    ("Vrot phototaxy", "P(Vrot | Theta1), phototaxy", "Vrot", VROT, False),
]


def _thing(name: str, kind: str, pose: tuple[float, float, float], height: float, **outline: Any) -> dict[str, Any]:
    movable = kind in ("block", "disc", "robot")
    return {"name": name, "kind": kind, "pose": list(pose), "height": height, "movable": movable, **outline}


def _box(width: float, depth: float) -> list[list[float]]:
    x, y = width / 2, depth / 2
    return [[-x, -y], [x, -y], [x, y], [-x, y]]


SHAPES = [
    _thing("base", "base", (0.91, 0.91, 0.0), 0.0, polygon=_box(0.18, 0.18)),
    _thing("base wall 1", "wall", (0.82, 0.9525, 1.5708), 0.06, polygon=_box(0.095, 0.008)),
    _thing("base wall 2", "wall", (0.9525, 0.82, 0.0), 0.06, polygon=_box(0.095, 0.008)),
    _thing("lamp", "lamp", (0.96, 0.96, 0.0), 0.075, radius=0.012),
    _thing("fixed 1", "fixed", (0.3, 0.14, 0.3), 0.08, polygon=_box(0.2, 0.01)),
    _thing("fixed 2", "fixed", (0.87, 0.3, 2.0), 0.08, polygon=_box(0.2, 0.01)),
    _thing("box", "block", (0.5, 0.86, 0.4), 0.08, polygon=_box(0.08, 0.05)),
    _thing("low box", "block", (0.12, 0.55, 1.0), 0.03, polygon=_box(0.07, 0.07)),
    _thing("can", "disc", (0.2, 0.8, 0.0), 0.03, radius=0.03),
    _thing("robot", "robot", (0.5, 0.23, 0.0), 0.029, radius=0.0285),
]


def manifest(world: bool = True) -> dict[str, Any]:
    """What the loop would say of such a run."""
    return {
        "port": "emulator",
        "period_s": 0.1,
        "clock": "wall",
        "questions": [
            {"key": key, "name": name, "variables": [variable], "values": [list(values)], "main": main}
            for key, name, variable, values, main in QUESTIONS
        ],
        "evidence": {"Dir": list(range(-10, 11)), "Prox": list(range(16)), "Theta1": list(range(-170, 181, 10))},
        "world": {"name": "furnished", "size": [1.0, 1.0], "shapes": SHAPES} if world else None,
    }


def ticks(count: int, seed: int = 1, world: bool = True) -> Iterator[Tick]:
    """``count`` ticks of 0.1 s."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        t = 0.1 * k
        turn = 0.21 * t
        x, y = 0.5 + 0.27 * np.sin(turn), 0.5 - 0.27 * np.cos(turn)
        near = float(np.clip(np.sin(0.5 * t), 0, 1))
        around = np.array([1, 0.9, 0.6, 0.2, 0.1, 0, 0, 0])
        proximity = np.clip(900 * near * around + rng.normal(0, 12, 8), 0, 1023).astype(int)
        bearing = np.arctan2(0.96 - y, 0.96 - x) - turn
        looks = np.radians([90, 45, 10, -10, -45, -90, 180, 180])
        light = np.clip(500 - 420 * np.clip(np.cos(bearing - looks), 0, 1) ** 2, 0, 511).astype(int)
        direction, prox = round(-7 * near), int(proximity.max() // 64)
        theta = int(np.round(np.degrees((np.pi - bearing) % (2 * np.pi) - np.pi) / 10) * 10)
        avoid = 1 / (1 + np.exp(-1.0 * (prox - 9)))
        away, toward = gaussian(6.0 * near, 1.6), gaussian(np.clip(theta / 12, -8, 8), 2.2)
        both = avoid * away + (1 - avoid) * toward
        u = float(rng.random())
        drawn = VROT[int(np.searchsorted(np.cumsum(both), u * both.sum()))]
        missed = 1 if k and k % 97 == 0 else 0
        yield Tick(
            tick=k,
            t=t,
            raw={"N": "n," + ",".join(map(str, proximity)), "O": "o," + ",".join(map(str, light))},
            orders=["N", "O", f"D,{5 + int(drawn)},{5 - int(drawn)}"],
            evidence={"Dir": direction, "Prox": prox, "Theta1": theta},
            clipped={"Theta1": 1} if k % 50 == 0 else {},
            answers={
                key: Answer(name, (variable,), (values,), p)
                for (key, name, variable, values, _), p in zip(
                    QUESTIONS, (both, np.array([avoid, 1 - avoid]), away, toward), strict=True
                )
            },
            u={"Vrot": u},
            draws={"Vrot": drawn},
            command=(5 + int(drawn), 5 - int(drawn)),
            events=_events(k, missed),
            missed=missed,
            late_ms=float(rng.gamma(2, 0.08)),
            work_ms=float(26 + rng.gamma(2, 0.3)),
            wall=1.77e9 + t,
            pose=(x, y, turn) if world else None,
            moved={"box": (0.5 - 0.001 * k, 0.86, 0.4 + 0.003 * k)} if world and 100 < k < 200 else {},
        )


def gaussian(mean: float, deviation: float) -> NDArray[np.float64]:
    """A discrete Gaussian over Vrot."""
    p = np.exp(-0.5 * ((np.arange(-10, 11) - mean) / deviation) ** 2)
    return np.asarray(p / p.sum())


def _events(k: int, missed: int) -> list[tuple[str, str]]:
    events = [("info", "running")] if k == 0 else []
    if missed:
        events.append(("warning", f"{missed} deadline skipped: the tick before took too long"))
    if k % 50 == 0:
        events.append(("info", "Theta1 clipped to -170..180"))
    return events
