"""Shapes for questions about what touches what."""

import math
from dataclasses import replace

from khepera_hil.world.shapes import Shape


def closer(shape: Shape, less: float) -> Shape:
    """At most ``less`` mm smaller on every side."""
    reach = max((math.hypot(*corner) for corner in shape.corners), default=shape.radius)
    share = 1 - less / reach
    parts = tuple(tuple((x * share, y * share) for x, y in part) for part in shape.convex)
    return replace(shape, corners=parts[0] if parts else (), parts=parts, radius=shape.radius * share)
