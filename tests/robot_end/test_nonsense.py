"""Nonsense does no harm; a million lines of it are ``python -m benchmarks.garbage``."""

from benchmarks.garbage import talk


def test_twenty_thousand_lines_of_nonsense_do_no_harm() -> None:
    assert talk(20_000, seed=7, arena="empty") > 100_000
