"""Small arenas of the tests' own."""

from __future__ import annotations

from pathlib import Path

__all__ = ["pushing"]


def pushing(folder: Path, *, mass: float = 40) -> Path:
    """A disc straight ahead of the robot, on a long floor."""
    path = folder / "pushing.toml"
    path.write_text(
        f"""
title = "a disc to push"
size_mm = [1500, 800]

[[disc]]
name = "object"
at_mm = [300, 400]
radius_mm = 25
height_mm = 40
mass_g = {mass}

[start]
at_mm = [220, 400]
heading_deg = 8
"""
    )
    return path
