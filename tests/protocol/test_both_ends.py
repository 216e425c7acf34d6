"""What one end writes the other reads, and no bytes whatever do harm."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_hil.errors import ProtocolError
from khepera_hil.protocol import (
    COMMAND_NOT_FOUND,
    COMMANDS,
    LED_ABSENT,
    LED_ACTION,
    LONGEST_LINE,
    PROTOCOL_ERROR,
    Field,
    RequestLines,
    RequestRefused,
    encode_answer,
    encode_request,
    is_refusal,
    parse_answer,
    parse_request,
    wire_seconds,
)
from khepera_hil.turrets import TURRET_ABSENT

Values = tuple[int | str, ...]
NUMBERS = [letter for letter, command in COMMANDS.items() if command.form == "numbers"]
PRINTABLE = "".join(chr(code) for code in range(33, 127) if chr(code) != ",")
WORDS = st.lists(st.text(PRINTABLE, min_size=1, max_size=5), max_size=8).map(
    lambda words: "".join(f",{w}" for w in words)
)
VERSIONS = st.builds("{}.{:02}{}".format, st.integers(0, 99), st.integers(0, 99), st.sampled_from(["", " beta"]))
LETTERS = st.sampled_from(sorted(COMMANDS))


def within(fields: tuple[Field, ...]) -> st.SearchStrategy[Values]:
    return st.tuples(*(st.integers(field.low, field.high) for field in fields))


@st.composite
def requests(draw: st.DrawFn) -> tuple[str, Values]:
    command = COMMANDS[draw(LETTERS)]
    values = draw(within(command.request))
    if command.form == "turret":
        values = (*values, draw(st.sampled_from("ABNTZ")) + draw(WORDS))
    return command.letter, values


@st.composite
def answers(draw: st.DrawFn) -> tuple[str, Values]:
    command = COMMANDS[draw(LETTERS)]
    if command.form == "versions":
        return command.letter, draw(st.tuples(VERSIONS, VERSIONS))
    values = draw(within(command.answer))
    if command.form == "turret":
        values = (*values, draw(st.sampled_from("abntz")) + draw(WORDS))
    return command.letter, values


# Bytes that are near the grammar find more than bytes that are anything.
NEARLY = st.one_of(
    st.binary(max_size=200),
    st.lists(
        st.sampled_from(
            [b",", b"-", b"0", b"7", b"99999", b"\r", b"\n", b" ", b"z,", *(c.encode() for c in "nNdDtTbBlL")]
        ),
        max_size=30,
    ).map(b"".join),
)


@given(requests())
def test_the_robot_reads_what_the_client_writes(request_: tuple[str, Values]) -> None:
    letter, values = request_
    line = encode_request(letter, *values)
    assert line.endswith(b"\n")
    assert parse_request(line[:-1]) == (letter, values)
    if COMMANDS[letter].form != "turret":
        assert len(line) <= COMMANDS[letter].longest_request


@given(answers())
def test_the_client_reads_what_the_robot_writes(answer: tuple[str, Values]) -> None:
    letter, values = answer
    line = encode_answer(letter, *values)
    assert line.endswith(b"\r\n")
    assert parse_answer(letter, line) == values
    assert not is_refusal(line)
    if COMMANDS[letter].form != "turret":
        assert len(line) <= COMMANDS[letter].longest_answer


@given(answers(), st.data())
def test_no_part_of_an_answer_and_no_two_answers_are_an_answer(
    answer: tuple[str, Values], data: st.DataObject
) -> None:
    letter, values = answer
    line = encode_answer(letter, *values)
    broken = data.draw(
        st.one_of(
            st.integers(0, len(line) - 1).map(lambda n: line[:n]),
            st.integers(1, len(line) - 1).map(lambda n: line[n:]),
            st.just(line + line),
            st.just(line.replace(b"\r", b"")),
            st.just(line.replace(b"\n", b"")),
            st.just(b"\r\n" + line),
            st.just(b" " + line),
        )
    )
    with pytest.raises(ProtocolError):
        parse_answer(letter, broken)


@given(LETTERS, LETTERS, answers())
def test_an_answer_to_another_letter_is_no_answer(asked: str, other: str, answer: tuple[str, Values]) -> None:
    letter, values = answer
    if asked != letter:
        with pytest.raises(ProtocolError):
            parse_answer(asked, encode_answer(letter, *values))


@given(NEARLY)
def test_any_bytes_are_a_request_an_empty_line_or_refused(line: bytes) -> None:
    try:
        request = parse_request(line)
    except RequestRefused as refused:
        reply = refused.reply
    else:
        if request is None:
            assert line == b""
        else:
            assert parse_request(encode_request(request[0], *request[1])[:-1]) == request
        return
    assert is_refusal(reply)
    assert reply.endswith(b"\r\n")


@given(LETTERS, NEARLY)
def test_any_bytes_are_an_answer_or_a_protocol_error(letter: str, line: bytes) -> None:
    with contextlib.suppress(ProtocolError):
        assert encode_answer(letter, *parse_answer(letter, line)) == line


@given(
    st.text(max_size=2) | LETTERS,
    st.lists(
        st.one_of(st.integers(), st.floats(), st.text(max_size=5), st.booleans(), st.none(), st.binary(max_size=2)),
        max_size=8,
    ),
)
def test_any_values_are_encoded_or_a_protocol_error(letter: str, values: list[int | str]) -> None:
    with contextlib.suppress(ProtocolError):
        assert parse_request(encode_request(letter, *values)[:-1]) == (letter, tuple(values))
    with contextlib.suppress(ProtocolError):
        assert parse_answer(letter, encode_answer(letter, *values)) == tuple(values)


@given(st.data())
def test_lines_are_the_same_however_they_are_chopped(data: st.DataObject) -> None:
    stream = data.draw(NEARLY)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    whole = RequestLines().feed(stream)
    editor = RequestLines()
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert [line for piece in pieces for line in editor.feed(piece)] == whole


@given(
    st.lists(st.text(PRINTABLE, min_size=1, max_size=LONGEST_LINE).map(str.encode), max_size=5),
    st.sampled_from([b"\r", b"\n", b"\r\n"]),
)
def test_a_line_may_end_in_cr_or_lf_or_both(lines: list[bytes], end: bytes) -> None:
    got = RequestLines().feed(b"".join(line + end for line in lines))
    assert [line for line in got if line] == lines


@given(st.integers(LONGEST_LINE + 1, 10_000), st.sampled_from([b"N", b" ", b"\xff", b","]))
def test_a_line_that_is_too_long_is_refused_once(length: int, letter: bytes) -> None:
    editor = RequestLines()
    lines = editor.feed(letter * length + b"\r\nN\n")
    assert [line for line in lines if line][1:] == [b"N"]
    assert len(lines[0]) == LONGEST_LINE + 1
    with pytest.raises(RequestRefused) as refused:
        parse_request(lines[0])
    assert refused.value.reply == PROTOCOL_ERROR


def test_a_line_of_exactly_the_longest_length_is_read() -> None:
    line = b"N" + b" " * (LONGEST_LINE - 1)
    assert RequestLines().feed(line + b"\n") == [line]
    assert parse_request(line) == ("N", ())


@pytest.mark.parametrize(
    ("line", "reply"),
    [
        (b"X", COMMAND_NOT_FOUND),
        (b"n", COMMAND_NOT_FOUND),
        (b" ", COMMAND_NOT_FOUND),
        (b"NN", COMMAND_NOT_FOUND),
        (b"\xffN", COMMAND_NOT_FOUND),
        (b"N,", PROTOCOL_ERROR),
        (b"N,1", PROTOCOL_ERROR),
        (b"D,5", PROTOCOL_ERROR),
        (b"D,5,5,5", PROTOCOL_ERROR),
        (b"D, 5,5", PROTOCOL_ERROR),
        (b"D,+5,5", PROTOCOL_ERROR),
        (b"D,5.0,5", PROTOCOL_ERROR),
        (b"D,128,0", PROTOCOL_ERROR),
        (b"D,0,-128", PROTOCOL_ERROR),
        (b"L,2,0", LED_ABSENT),
        (b"L,0,3", LED_ACTION),
        (b"T,2", PROTOCOL_ERROR),
        (b"T,32,N", PROTOCOL_ERROR),
    ],
)
def test_what_is_no_request_is_refused_in_the_robots_words(line: bytes, reply: bytes) -> None:
    with pytest.raises(RequestRefused) as refused:
        parse_request(line)
    assert refused.value.reply == reply


def test_blanks_around_a_request_are_ignored() -> None:
    assert parse_request(b"  D,5,-5\t") == ("D", (5, -5))


@pytest.mark.parametrize("reply", [COMMAND_NOT_FOUND, PROTOCOL_ERROR, LED_ABSENT, LED_ACTION, TURRET_ABSENT])
def test_no_refusal_is_an_answer(reply: bytes) -> None:
    assert is_refusal(reply)
    for letter in COMMANDS:
        with pytest.raises(ProtocolError):
            parse_answer(letter, reply)


@pytest.mark.parametrize("word", [b"01", b"-0", b"+1", b" 1", b"1 ", b"", b"1.0", b"1024", b"-1", "١".encode()])
def test_a_reading_is_plain_decimal_in_its_range(word: bytes) -> None:
    with pytest.raises(ProtocolError):
        parse_answer("N", b"n,0,0,0," + word + b",0,0,0,0\r\n")


def test_integers_of_numpy_are_integers() -> None:
    assert encode_request("D", np.int64(-3), np.int16(4)) == b"D,-3,4\n"  # type: ignore[arg-type]  # mypy sees no int


@pytest.mark.parametrize(
    ("letter", "sent", "received"),
    # The table of wire times: characters of the request and of the longest answer.
    [("N", 2, 43), ("O", 2, 43), ("H", 2, 27), ("E", 2, 13), ("D", 12, 3)],
)
def test_the_longest_exchanges_have_the_tables_lengths(letter: str, sent: int, received: int) -> None:
    assert (COMMANDS[letter].longest_request, COMMANDS[letter].longest_answer) == (sent, received)


@pytest.mark.parametrize(
    ("characters", "baud", "milliseconds"),
    [(45, 9600, 51.6), (45, 19200, 25.8), (45, 38400, 12.9), (29, 9600, 33.2), (15, 38400, 4.3), (12, 9600, 13.8)],
)
def test_a_character_is_eleven_bit_times(characters: int, baud: int, milliseconds: float) -> None:
    assert wire_seconds(characters, baud) * 1000 == pytest.approx(milliseconds, abs=0.06)


def test_the_table_holds_the_manuals_eighteen_commands() -> None:
    assert "".join(sorted(COMMANDS)) == "ABCDEFGHIJKLNOPRTW"
    assert len(NUMBERS) == 16
