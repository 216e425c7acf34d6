"""What is told of a campaign on its way."""

from __future__ import annotations

import io

import pytest

from khepera_hil.experiments.progress import Progress, duration


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_what_is_done_how_fast_and_what_remains() -> None:
    now = [0.0]
    stream = io.StringIO()
    progress = Progress("push", 100, 20, stream, lambda: now[0])
    assert progress.line() == "push: 0 of 100 trials, 20 known from before"
    now[0] = 10.0
    progress.done(40)
    assert progress.line() == "push: 40 of 100 trials, 4 a second, about 15 s left, 20 known from before"
    now[0] = 14.0  # nothing has ended since: the remaining time goes on running
    assert progress.line() == "push: 40 of 100 trials, 4 a second, about 11 s left, 20 known from before"
    now[0] = 1000.0
    progress.done(20)
    assert progress.line() == "push: 60 of 100 trials, 3.6 a minute, about 11 min left, 20 known from before"
    progress.done(40)
    assert "left" not in progress.line()


def test_a_file_gets_a_line_now_and_then_and_a_terminal_one_that_changes() -> None:
    for stream, lines, returns in ((io.StringIO(), 4, 0), (Terminal(), 2, 11)):
        now = [0.0]
        progress = Progress("push", 10, 0, stream, lambda: now[0])  # noqa: B023  (called here only)
        for second in range(1, 31):
            now[0] = float(second)
            if second % 3 == 0:
                progress.done(1)
            if stream.isatty() and second % 3:
                continue
            progress.tell()
        if stream.isatty():
            progress.say("a worker was killed")
        progress.end()
        told = stream.getvalue()
        assert told.count("\n") == lines + (1 if stream.isatty() else 0)
        assert told.count("\r") == returns
        assert told.endswith("\n")
    Progress("push", 10, 0, None).end()


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.4, "0 s"), (99, "99 s"), (100, "2 min"), (5999, "1 h 40 min"), (3 * 3600, "3 h 00 min"), (5930, "99 min")],
)
def test_durations(seconds: float, words: str) -> None:
    assert duration(seconds) == words
