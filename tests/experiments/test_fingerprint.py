"""What a trial's results depend on: all that it can import, and no more than that."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from khepera_hil.experiments import fingerprint
from khepera_hil.experiments.experiment import no_trial
from khepera_hil.experiments.fingerprint import code_of
from khepera_hil.experiments.registry import EXPERIMENTS
from tests.runs.cli import ROOT, environment

TRIALS = sorted(
    {experiment.trial.__module__ for experiment in EXPERIMENTS.values() if experiment.trial is not no_trial}
)


def test_no_experiment_depends_on_the_command_line_or_on_campaigns() -> None:
    assert len(TRIALS) > 4
    for module in TRIALS:
        modules = code_of(module).modules
        assert {module, "brp.plan", "khepera_hil.ports.protocol_emulator", "khepera_hil.world.world"} <= modules
        assert not [name for name in modules if name.startswith("khepera_hil.commands")]
        assert not modules & {"khepera_hil.experiments.campaign", "khepera_hil.experiments.registry"}


@pytest.mark.parametrize("name", ["phototaxy", "watchman"])
def test_all_that_a_trial_loads_is_counted(name: str) -> None:
    """A whole trial in a process of its own, and what is loaded when it is over."""
    experiment = EXPERIMENTS[name]
    module = experiment.trial.__module__
    case = {**experiment.cases([1])[-1], **({"seconds": 5.0} if name == "watchman" else {})}
    program = (
        f"import sys, json, {module} as it; it.{experiment.trial.__name__}(json.loads({json.dumps(case)!r}));"
        "print(*[n for n in sys.modules if n.partition('.')[0] in ('brp', 'khepera_hil')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT, env=environment()
    )
    loaded = set(done.stdout.split())
    assert "khepera_hil.ports.protocol_emulator" in loaded, "which pyserial imports by a text"
    assert not loaded - code_of(module).modules


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where a package ``own`` can be imported from."""
    monkeypatch.syspath_prepend(tmp_path)
    forget()
    yield tmp_path
    forget()


def forget() -> None:
    """As a new process, which has looked at nothing."""
    for known in (
        fingerprint.code_of,
        fingerprint._first,
        fingerprint._parsed,
        fingerprint._file,
        fingerprint._folder,
    ):
        known.cache_clear()
    importlib.invalidate_caches()


def of(folder: Path, **files: str) -> tuple[str, set[str]]:
    """Digest and modules of a package ``own``, whose trial imports ``near`` at its top."""
    files = {"__init__": "", "trial": "import own.near\n", "near": "", "far": "", "other": "", **files}
    (folder / "own" / "deep").mkdir(parents=True, exist_ok=True)
    for name, text in {**files, "deep/__init__": "", "deep/leaf": ""}.items():
        (folder / "own" / f"{name}.py").write_text(text)
    forget()
    code = code_of("own.trial")
    return code.digest, {name for name in code.modules if name.startswith("own")}


ALL = {"own", "own.trial", "own.near", "own.far", "own.other", "own.deep", "own.deep.leaf"}


@pytest.mark.parametrize(
    ("text", "more"),
    [
        ("import own.near\n", set()),
        ("def late():\n    from own import far\n", {"own.far"}),
        ("def late():\n    from .far import something\n", {"own.far"}),
        ("from own.deep import leaf as l\n", {"own.deep", "own.deep.leaf"}),
        ("from .deep.leaf import x\n", {"own.deep", "own.deep.leaf"}),
        ("NAME = 'own.deep'\n", {"own.deep", "own.deep.leaf"}),
        ("NAME = 'own.nothing'\n", set()),
        ("import importlib\ndef f(name):\n    importlib.import_module('own.' + name)\n", ALL),
        ("def f(name):\n    exec('import own.' + name)\n", ALL),
        ("def f(x):\n    '''import is only told of here'''\n    return eval('x + 1')\n", set()),
    ],
)
def test_what_a_module_names_is_counted(own: Path, text: str, more: set[str]) -> None:
    _, modules = of(own, near=text)
    assert modules == {"own", "own.trial", "own.near"} | more


def test_a_change_counts_where_it_can_be_met(own: Path) -> None:
    before = of(own)
    assert of(own, other="x = 1\n") == before
    assert of(own, near="x = 1\n")[0] != before[0]
    assert of(own, __init__="x = 1\n")[0] != before[0]


def test_a_file_that_was_touched_is_not_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "own_alone.py"
    file.write_text("x = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    code = code_of("own_alone")
    file.touch()
    assert code.changed() is None
    file.write_text("x = 2\n")
    assert code.changed() == file
    file.write_text("x = 1\n")
    assert code.changed() is None
    file.unlink()
    assert code.changed() == file
