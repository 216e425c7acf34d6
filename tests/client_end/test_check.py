"""``khepera-hil check``: what it finds, what it remarks, and that no wheel moves."""

from __future__ import annotations

import json
from typing import Any

import pytest

from khepera_hil.__main__ import outcome
from khepera_hil.protocol import RequestLines
from tests.client_end.robots import Cable, Robot

QUICK = ("--n", "5", "--seconds", "0.7", "--json")


def result(text: str) -> dict[str, Any]:
    found = json.loads(text.splitlines()[-1])
    assert isinstance(found, dict)
    return found


def test_the_emulated_robot_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    outcome(["check", *QUICK])  # whether this machine was punctual is none of the test's business
    said = capsys.readouterr().out
    found = result(said)
    assert "emulator://furnished at 38400 baud" in said
    assert found["robot"]["bios"]
    assert len(found["proximity"]) == len(found["light"]) == 8
    assert found["round_trips_ms"]["N"]["asked"] == 5
    assert found["round_trips_ms"]["N"]["lost"] == 0
    assert found["loop_late_ms"]["ticks"] > 0
    assert found["budget"]["home"]["9600"]["fits"] is False
    assert found["budget"]["home"]["38400"] == {
        "ms": 34.4, "fits": True, "verified_ms": 85.9, "verified_fits": True
    }  # fmt: skip


def test_on_a_bad_line_the_check_goes_on_and_counts(capsys: pytest.CaptureFixture[str]) -> None:
    port = "emulator://empty?faults=flip=0.01,boot@1.5/1&robot=khepera2"
    assert outcome(["check", "--port", port, "--baud", "115200", "--n", "40", "--seconds", "1", "--json"]) == 1
    said = capsys.readouterr().out
    assert "robot     Khepera II: BIOS 6.01" in said
    trips = result(said)["round_trips_ms"]
    assert 0 < sum(of_letter["lost"] for of_letter in trips.values()) < 80
    assert "requests had no usable answer: see the cable" in said
    assert "0 charger:" in said


def test_what_should_be_looked_at_is_said_and_no_wheel_is_moved(
    cable: Cable, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = Robot(cable.end)
    robot.answers |= {"N": (1023, 0, 3, 0, 0, 0, 0, 0), "E": (5, -5), "I": (512,)}
    try:
        assert outcome(["check", "--port", cable.name, *QUICK]) == 1
    finally:
        robot.off()
    said = capsys.readouterr().out
    assert "\n! the wheels turn at (5, -5)" in said
    assert "\n! proximity at left 90 is always 1023 or more: does something touch it?" in said
    assert "\n! proximity at left 10 is always 3, without any noise: is it stuck?" in said
    assert "proximity at right 45" not in said
    assert "\n! light at left 90 is always 498, without any noise" in said
    assert "          dark; " in said
    assert "inputs    0: 2.04 V, 1: 2.04 V" in said
    assert result(said)["inputs"]["7"] == 512
    asked = {line[:1] for line in RequestLines().feed(bytes(robot.heard))}
    assert {b"B", b"E", b"T", b"n", b"I", b"N", b"O"} <= asked
    assert not asked & {b"A", b"C", b"D", b"F", b"G", b"J", b"L", b"P", b"W", b"r", b"s"}


def test_a_port_without_a_robot_has_its_exit_code(cable: Cable, capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome(["check", "--port", cable.name, *QUICK]) == 4
    assert "no Khepera answers" in capsys.readouterr().err
    assert outcome(["check", "--port", "/dev/nowhere", *QUICK]) == 3
    assert outcome(["check", "--port", cable.name, "--n", "none"]) == 2
    assert "is no number of times" in capsys.readouterr().err


def test_a_period_that_the_line_cannot_keep_is_not_the_computers_fault(capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome(["check", "--period", "0.02", "--n", "1", "--seconds", "0.2"]) == 1
    said = capsys.readouterr().out
    assert "! N and O need 34 ms at this rate: a loop of 20 ms cannot read them" in said
    assert "is this computer busy" not in said
