import pytest
from statemachine.exceptions import TransitionNotAllowed

from khepera_hil.lifecycle import Lifecycle

FITS = {
    ("disconnected", "connect"): "connecting",
    ("connecting", "connected"): "ready",
    ("ready", "start"): "running",
    ("ready", "stop"): "stopping",
    ("running", "stop"): "stopping",
    ("stopping", "rest"): "stopped",
    ("disconnected", "fail"): "faulted",
    ("connecting", "fail"): "faulted",
    ("ready", "fail"): "faulted",
    ("running", "fail"): "faulted",
    ("stopping", "fail"): "faulted",
}
STATES = ["disconnected", "connecting", "ready", "running", "stopping", "stopped", "faulted"]
EVENTS = ["connect", "connected", "start", "stop", "rest", "fail"]


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("event", EVENTS)
def test_every_event_in_every_state_fits_or_is_refused_loudly(state: str, event: str) -> None:
    life = Lifecycle(start_value=state)
    if (state, event) in FITS:
        life.send(event)
        assert life.current_state_value == FITS[state, event]
    else:
        with pytest.raises(TransitionNotAllowed):
            life.send(event)
        assert life.current_state_value == state


def test_the_table_above_knows_all_states_and_events() -> None:
    assert {state.id for state in Lifecycle.states} == set(STATES)
    assert {event.id for event in Lifecycle().events} == set(EVENTS)
