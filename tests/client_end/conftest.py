"""What the tests of real ports share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.client_end.robots import Cable


@pytest.fixture
def cable() -> Iterator[Cable]:
    cable = Cable()
    yield cable
    cable.pull()
