"""Calibration of the light sensors (section 6.2): alpha, beta, levels and deviation of each, by turning on the spot
before a lamp.

"It may be easy and interesting to calibrate specifically each of the eight light sensors ... by identifying
parameters alpha and beta independently for each sensor, by observing the response of the particular sensor to a
light source." The robot turns; its wheels' counters say by how much; each sensor's readings over the bearing are
S6.4's curve.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp import Question
from brp.programs.lamp import LEAK, LightSensor
from brp.programs.sensor import BEARINGS
from khepera_hil.controllers import Decision
from khepera_hil.errors import RecordingError, UsageError
from khepera_hil.perception import Odometry, Readings

__all__ = ["Turning", "calibrated", "read_calibration", "write_calibration"]

_FORMAT = "light sensors"
_LEAST = 60.0
"""Counts by which the lamp must show in every sensor."""


@dataclass
class Turning:
    """A controller that turns on the spot and keeps what it sees: heading (degrees clockwise from the first) and
    light. It does not leave its place, so nothing is asked.
    """

    speed: int = 4
    """Of either wheel, in units of command D."""
    headings: list[float] = field(default_factory=list)
    light: list[tuple[int, ...]] = field(default_factory=list)

    name = "calibrate"
    decides = "Vrot"
    needs = ("O", "H")
    questions: Mapping[str, Question] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._odometry = Odometry()

    def step(self, readings: Readings, rng: np.random.Generator) -> Decision:
        """Look, and turn on to the right."""
        self._odometry.step(readings)
        self.headings.append(-math.degrees(self._odometry.heading))
        self.light.append(readings.light)
        return Decision({}, {}, {}, {}, self.speed, -self.speed)


def calibrated(headings: Sequence[float], light: Sequence[Sequence[int]]) -> tuple[LightSensor, ...]:
    """The eight sensors, from the robot's headings (degrees clockwise) and its readings, shape (n, 8).

    Where the lamp is need not be told: the sensors look on average where figure 3 has them. Raises UsageError when
    the robot did not turn all the way round, or saw too little of a lamp.
    """
    from scipy.optimize import least_squares

    heading = np.array(headings)
    readings = np.array(light, dtype=np.float64).reshape(-1, 8)
    if len(heading) < 40 or heading.max() - heading.min() < 360:
        raise UsageError(
            "the robot has not turned all the way round: do its wheels turn freely? let it turn longer"
        )
    fits = []
    for i, nominal in enumerate(BEARINGS):
        seen = readings[:, i]
        dark = float(np.percentile(seen, 90))
        if dark - seen.min() < _LEAST:
            raise UsageError(
                f"L{i + 1} sees too little of a lamp (its readings differ by {dark - seen.min():.0f}): put one 200 "
                "to 300 mm away, at the height of the sensors, and keep other lights away"
            )
        # The sensor looks at the lamp when the robot is turned by the lamp's bearing less the sensor's own.
        facing = float(heading[int(seen.argmin())])

        def misses(p: NDArray[np.float64], seen: NDArray[np.float64] = seen) -> NDArray[np.float64]:
            sensor = LightSensor(alpha=p[0], beta=p[1], dark=p[2])
            lit = np.minimum(1, p[3] * (sensor.K(heading - p[4]) + LEAK))
            found: NDArray[np.float64] = sensor.dark - (sensor.dark - sensor.bright) * lit - seen
            return found

        # The turn in which the reading was lowest is only a beginning: noise moves it.
        start = [50.0, 0.022, dark, (dark - seen.min()) / (dark - 72.0), facing]
        bounds = ([20, 0.005, 300, 0.01, facing - 60], [80, 0.1, 520, 20, facing + 60])
        fit = least_squares(misses, np.clip(start, *bounds), bounds=bounds, loss="soft_l1", f_scale=15.0)
        fits.append((fit.x, float(np.sqrt(np.mean(fit.fun[np.abs(seen - dark) < 15] ** 2))), nominal))
    # Where the lamp was: the mean of what each sensor says of it.
    says = [math.radians(x[4] + nominal) for x, _, nominal in fits]
    lamp = math.degrees(math.atan2(sum(map(math.sin, says)), sum(map(math.cos, says))))
    strength = math.exp(sum(math.log(x[3]) for x, _, _ in fits) / 8)
    return tuple(
        LightSensor(
            alpha=round(float(x[0]), 2),
            beta=round(float(x[1]), 5),
            dark=round(float(x[2]), 1),
            deviation=round(max(1.0, deviation), 2),
            beside=round((lamp - x[4] - nominal + 180) % 360 - 180, 2),
            gain=round(float(x[3]) / strength, 3),
        )
        for x, deviation, nominal in fits
    )


def write_calibration(sensors: Sequence[LightSensor], path: Path) -> None:
    """Write the file. Raises RecordingError."""
    content = {"format": _FORMAT, "version": 1, "sensors": [asdict(sensor) for sensor in sensors]}
    try:
        path.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    except OSError as error:
        raise RecordingError(f"the calibration {path} cannot be written: {error.strerror or error}") from None


def read_calibration(path: Path) -> tuple[LightSensor, ...]:
    """The eight sensors of a file. Raises UsageError for anything else."""
    try:
        content = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise UsageError(f"the calibration {path} cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path} is no calibration: {error}") from None
    wrong = UsageError(f"{path} is no calibration: make one with khepera-hil calibrate")
    if not isinstance(content, dict) or content.get("format") != _FORMAT or content.get("version") != 1:
        raise wrong
    rows = content.get("sensors")
    if not isinstance(rows, list) or len(rows) != 8:
        raise wrong
    return tuple(_sensor(row, wrong) for row in rows)


_RANGES = {
    "alpha": (1, 180),
    "beta": (0.001, 1),
    "dark": (100, 511),
    "bright": (0, 400),
    "deviation": (0.1, 100),
    "beside": (-60, 60),
    "gain": (0.05, 20),
}


def _sensor(row: Any, wrong: UsageError) -> LightSensor:
    names = {one.name for one in fields(LightSensor)}
    if not isinstance(row, dict) or set(row) != names:
        raise wrong
    for name, value in row.items():
        low, high = _RANGES[name]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise UsageError(f"{wrong} ({name} is {value!r:.40}, and goes from {low:g} to {high:g})")
    return LightSensor(**{name: float(value) for name, value in row.items()})
