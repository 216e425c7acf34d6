"""The turrets' tables: what one end writes the other reads, and nothing else is taken."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.errors import ProtocolError
from khepera_hil.fields import Command, RequestRefused
from khepera_hil.protocol import COMMANDS, encode_answer, encode_request, is_refusal, parse_answer, parse_request
from khepera_hil.turrets import (
    TURRETS,
    encode_turret_answer,
    encode_turret_request,
    parse_turret_answer,
    parse_turret_request,
)

ALL = st.sampled_from(
    [(number, command) for number, turret in TURRETS.items() for command in turret.commands.values()]
)


@given(ALL, st.data())
def test_both_ends_agree_through_the_protocols_own_lines(which: tuple[int, Command], data: st.DataObject) -> None:
    number, command = which
    asked = [data.draw(st.integers(field.low, field.high)) for field in command.request]
    told = [data.draw(st.integers(field.low, field.high)) for field in command.answer]
    line = encode_request("T", number, encode_turret_request(number, command.letter, *asked))
    request = parse_request(line[:-1])
    assert request is not None
    letter, (turret, text) = request
    assert (letter, turret) == ("T", number)
    assert parse_turret_request(number, str(text)) == (command.letter, asked)
    answer = encode_answer("T", number, encode_turret_answer(number, command.letter, *told))
    turret, text = parse_answer("T", answer)
    assert turret == number
    assert parse_turret_answer(number, command.letter, str(text)) == tuple(told)
    assert len(answer) <= COMMANDS["T"].longest_answer


@given(st.sampled_from(sorted(TURRETS)), st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=20))
def test_any_text_is_a_turrets_request_or_refused(number: int, text: str) -> None:
    try:
        letter, values = parse_turret_request(number, text)
    except RequestRefused as refused:
        reply = refused.reply
    else:
        assert parse_turret_request(number, encode_turret_request(number, letter, *values)) == (letter, values)
        return
    assert is_refusal(reply)


@given(ALL, st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=30))
def test_any_text_is_a_turrets_answer_or_an_error(which: tuple[int, Command], text: str) -> None:
    number, command = which
    with contextlib.suppress(ProtocolError):
        assert (
            encode_turret_answer(number, command.letter, *parse_turret_answer(number, command.letter, text)) == text
        )


@pytest.mark.parametrize(("number", "letter"), [(3, "B"), (2, "X"), (2, ""), (99, "B")])
def test_what_no_turret_has_is_not_encoded(number: int, letter: str) -> None:
    with pytest.raises(ProtocolError, match="no turret"):
        encode_turret_request(number, letter)
