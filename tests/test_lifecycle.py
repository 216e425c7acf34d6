"""Every state and every event, with every answer that the guards can give; and the docs say what the code does."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest
from statemachine.exceptions import TransitionNotAllowed

from khepera_hil.lifecycle import AILING, WINDOW, Health, Lifecycle, diagram

DOCS = Path(__file__).parents[1] / "docs" / "service.md"

STATES = ["disconnected", "connecting", "ready", "running", "degraded", "stopping", "stopped", "faulted"]
EVENTS = ["connect", "connected", "start", "degrade", "recover", "lose", "reset", "stop", "rest", "fail"]
ALIVE = ["disconnected", "connecting", "ready", "running", "degraded"]
ON_A_LINE = ["connecting", "ready", "running", "degraded"]
SHAKEN = ["ready", "running", "degraded"]

# A target, or where a guard decides, the target for the conditions that it asks.
FITS: dict[tuple[str, str], Callable[[Health], str | None]] = {
    ("disconnected", "connect"): lambda health: "connecting",
    ("connecting", "connected"): lambda health: "ready" if health.rested else None,
    ("ready", "start"): lambda health: ("degraded" if health.ailing else "running") if health.may_move else None,
    ("running", "degrade"): lambda health: "degraded" if health.ailing else None,
    ("degraded", "recover"): lambda health: "running" if health.sound else None,
    ("stopping", "rest"): lambda health: "stopped" if health.rested else None,
    **{(state, "lose"): lambda health: "disconnected" for state in ON_A_LINE},
    **{(state, "reset"): lambda health: "connecting" for state in SHAKEN},
    **{(state, "stop"): lambda health: "stopping" for state in ALIVE},
    **{(state, "fail"): lambda health: "faulted" for state in [*ALIVE, "stopping"]},
}


def healths() -> list[Health]:
    """All that the guards can tell apart: well, ailing, neither; may move or not; at rest or not."""
    found = []
    for ticks, may_move, rested in product(
        [[True] * WINDOW, [False] * AILING, [True] * 3], [True, False], [True, False]
    ):
        health = Health()
        for good in ticks:
            health.add(good)
        health.may_move, health.rested = may_move, rested
        found.append(health)
    return found


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("event", EVENTS)
def test_every_event_in_every_state_fits_or_is_refused_loudly(state: str, event: str) -> None:
    for health in healths():
        life = Lifecycle(health, start_value=state)
        fits = FITS.get((state, event))
        target = None if fits is None else fits(health)
        if target is None:
            with pytest.raises(TransitionNotAllowed):
                life.send(event)
            assert life.current_state_value == state
        else:
            life.send(event)
            assert life.current_state_value == target


def test_the_table_above_knows_all_states_and_events() -> None:
    assert {state.id for state in Lifecycle.states} == set(STATES)
    assert {event.id for event in Lifecycle(Health()).events} == set(EVENTS)


def test_an_error_in_a_guard_is_not_swallowed() -> None:
    class Fragile(Health):
        broken = False

        @property
        def ailing(self) -> bool:
            if self.broken:
                raise ZeroDivisionError
            return True

    health = Fragile()
    life = Lifecycle(health, start_value="running")
    health.broken = True
    with pytest.raises(ZeroDivisionError):
        life.send("degrade")
    assert life.current_state_value == "running"


def test_three_bad_ticks_in_ten_are_ailing_and_ten_good_ones_in_a_row_are_sound() -> None:
    health = Health()
    said = []
    for good in [False, True, False, *[True] * 6, False, True, *[True] * 9]:
        health.add(good)
        said.append((health.ailing, health.sound))
    assert [ailing for ailing, _ in said] == [False] * 9 + [True] + [False] * 10
    assert [sound for _, sound in said] == [False] * 19 + [True]


def test_nothing_is_sound_before_it_has_gone_well_for_a_while() -> None:
    assert not Health().sound
    assert not Health().ailing


def test_the_docs_show_the_chart_that_the_code_has() -> None:
    assert f"```mermaid\n{diagram().strip()}\n```" in DOCS.read_text()
