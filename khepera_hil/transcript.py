"""A tick's exchanges as the log keeps them: under which name each stands, and the readings that they were."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from khepera_hil.errors import ProtocolError
from khepera_hil.perception import Need, Readings
from khepera_hil.plausible import TRUST, settled
from khepera_hil.protocol import parse_answer

__all__ = ["name_of", "numbers", "readings"]

_FIELDS = {"N": "proximity", "O": "light"}


def name_of(request: bytes, raw: Mapping[str, str]) -> str:
    """Where the answer to ``request`` belongs in ``raw``: under its letter, or all of it where a letter asks much.

    What is asked again in the same tick is numbered: ``N``, ``N 2``, ``N 3``.
    """
    asked = request.strip().decode("ascii")
    name = asked if asked[0] in "IRT" else asked[0]
    again = sum(known.partition(" ")[0] == name for known in raw)
    return f"{name} {again + 1}" if again else name


def readings(raw: Mapping[str, str], needs: Iterable[str | Need]) -> Readings | None:
    """What a program with these needs was given in the tick; None where something is missing that is
    always due and cannot be done without."""
    named: dict[str, tuple[int, ...]] = {}
    answers: dict[tuple[int | str, ...], tuple[int | str, ...]] = {}
    for need in needs:
        need = Need(need) if isinstance(need, str) else need
        name = str(need) if need.letter in "IRT" else need.letter
        texts = [raw[key] for key in (name, f"{name} 2", f"{name} 3") if key in raw]
        if not texts and (need.every > 1 or need.without):
            continue
        try:
            values = [parse_answer(need.letter, text.encode("ascii", "replace") + b"\r\n") for text in texts]
            if not values:
                return None
            if need.letter in TRUST:
                named[_FIELDS[need.letter]] = settled([tuple(int(v) for v in one) for one in values])
            else:
                answers[(need.letter, *need.values)] = numbers(need, values[-1])
        except ProtocolError:
            return None
    return Readings(**named, answers=answers)


def numbers(need: Need, values: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """A need's answer as a program gets it: a turret's as its letter and its numbers. Raises ProtocolError."""
    if need.letter != "T":
        return values
    letter, *words = str(values[1]).split(",")
    try:
        return (letter, *map(int, words))
    except ValueError:
        raise ProtocolError(f"the turret's answer to {need} is no list of numbers: {values[1]!r}") from None
