"""Real recordings, made once by the emulator: copies are for those who damage them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from khepera_hil.__main__ import outcome
from khepera_hil.reading import Run, find
from tests.runs.cli import khepera_hil

SECONDS = 12


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of runs: home with seed 8 twice and seed 9 once, and avoid, which is the last."""
    folder = tmp_path_factory.mktemp("recorded")
    for program, seed in (("home", 8), ("home", 8), ("home", 9), ("avoid", 4)):
        done = khepera_hil(
            *("--program", program, "--fast", "--duration", str(SECONDS), "--seed", str(seed)),
            *("--runs", folder, "--json"),
            cwd=folder,
        )
        assert done.code == 0, done.err
        Path(done.result["run"]).rename(folder / f"{program}-{seed}-{len(list(folder.iterdir()))}")
    return folder


@pytest.fixture(scope="session")
def home(runs: Path) -> Run:
    """Home with seed 8."""
    return find("home-8-1", runs)


@pytest.fixture
def copy(home: Run, tmp_path: Path) -> Path:
    """A copy of it in ``tmp_path/runs/copy``, without the viewer's file."""
    folder = tmp_path / "runs" / "copy"
    shutil.copytree(home.folder, folder, ignore=shutil.ignore_patterns("*.rrd"))
    return folder


@dataclass(frozen=True)
class Said:
    code: int
    out: str
    err: str


@pytest.fixture
def say(capsys: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    """The command line, in this process."""

    def command(*words: str | Path) -> Said:
        capsys.readouterr()
        code = outcome([str(word) for word in words])
        printed = capsys.readouterr()
        return Said(code, printed.out, printed.err)

    return command
