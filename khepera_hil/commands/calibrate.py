"""``khepera-hil calibrate``: what each light sensor is like, by turning on the spot before a lamp (section 6.2)."""

from __future__ import annotations

import json
import secrets
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from khepera_hil.commands.address import port_url
from khepera_hil.commands.parser import Parser, baud, number, seed
from khepera_hil.commands.run import parser_of_run
from khepera_hil.commands.session import run_on_robot
from khepera_hil.errors import UsageError
from khepera_hil.teaching.calibration import Turning, calibrated, write_calibration

__all__ = ["main"]

EPILOG = """\
Put a lamp 200 to 300 mm from the robot, at the height of its sensors, and keep other lights away. The robot turns
on the spot, and does not leave its place.

examples:
  khepera-hil calibrate --port /dev/ttyS0 --out sensors.json
  khepera-hil --program fusion --calibration sensors.json
"""


def main(arguments: Sequence[str]) -> int:
    """Turn, look, and say what the sensors are like."""
    asked = _parser().parse_args(arguments)
    if asked.out.exists() and not asked.force:
        raise UsageError(f"{asked.out} is there already: choose another name, or say --force")
    chosen = secrets.randbits(32) if asked.seed is None else asked.seed
    world = asked.world or ("calibration" if asked.port.lower() == "emulator" else None)
    words = ["--port", asked.port, "--baud", str(asked.baud), "--seed", str(chosen)]
    run = parser_of_run().parse_args([*words, "--duration", str(asked.duration), "--runs", str(asked.runs)])
    run.fast, run.world, run.program = asked.fast, world, "calibrate"
    turning = Turning()
    url = port_url(run.port, run.world, run.scenario, fast=run.fast, seed=chosen, faults=None)
    run_on_robot(run, chosen, url, turning, {})
    sensors = calibrated(turning.headings, turning.light)
    print("sensor  alpha    beta   dark  deviation  beside  gain")
    for i, one in enumerate(sensors, 1):
        print(
            f"L{i}      {one.alpha:5.1f}  {one.beta:.4f}  {one.dark:5.1f}  {one.deviation:9.1f}  "
            f"{one.beside:+6.1f}  {one.gain:4.2f}"
        )
    write_calibration(sensors, asked.out)
    print(f"calibration in {asked.out}")
    if asked.json:
        print(json.dumps({"sensors": [asdict(one) for one in sensors]}))
    return 0


def _parser() -> Parser:
    parser = Parser("khepera-hil calibrate", "What each light sensor is like, by turning before a lamp.", EPILOG)
    add = parser.add_argument
    add("--port", default="emulator", help="as of khepera-hil (default: %(default)s)")
    add("--out", type=Path, required=True, metavar="FILE", help="the calibration")
    add("--force", action="store_true", help="write it also where a file is already")
    add("--duration", type=number(10, 600, "seconds"), default=40.0, metavar="SECONDS", help="(default: 40)")
    add("--baud", type=baud, default=38400, help="the rate of the robot's mode (default: %(default)s)")
    add("--seed", type=seed, help="of all chance (default: a new one)")
    add("--world", metavar="ARENA", help="of the emulator (default: one with a lamp before the robot)")
    add("--fast", action="store_true", help="simulated time; in-process emulator only")
    add("--runs", type=Path, default=Path("runs"), metavar="DIR", help="where the recording goes")
    add("--json", action="store_true", help="the last line on standard output is the calibration as JSON")
    return parser
