"""Damaged, truncated and foreign files: one sentence and exit code 6, or else no harm; never a traceback."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from khepera_hil.__main__ import outcome
from khepera_hil.errors import RecordingError
from khepera_hil.reading import Run, find, tick_of
from khepera_hil.recording import LOG, MANIFEST, Recording
from khepera_hil.viewer import FILE, remake
from khepera_hil.viewer.check import damage
from tests.recording.test_recording import STARTED
from tests.runs.cli import environment

FEW = 12
"""Ticks of the run that is damaged: small, so that most places of it are hit."""


@pytest.fixture(scope="module")
def small(home: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small") / "run"
    folder.mkdir()
    shutil.copy(home.folder / MANIFEST, folder)
    lines = (home.folder / LOG).read_bytes().splitlines(keepends=True)
    (folder / LOG).write_bytes(b"".join(lines[:FEW]))
    return folder


def calm(folder: Path, *, commands: tuple[list[str], ...]) -> None:
    """Every command on the run ends in an exit code of its own, and what it says on the way is one sentence."""
    for words in commands:
        said = StringIO()
        with redirect_stderr(said), redirect_stdout(StringIO()):
            code = outcome([word.replace("RUN", str(folder)) for word in words])
        assert code in (0, 1, 2, 6), words
        if code in (2, 6):
            assert said.getvalue().startswith("khepera-hil: ")
            assert said.getvalue().count("\n") == 1, said.getvalue()


COMMANDS = (
    ["replay", "RUN"],
    ["replay", "RUN", "--program", "avoid"],
    ["compare", "RUN", "RUN"],
    ["explain", "RUN", "--at", "0.5"],
    ["export", "RUN", "--csv", "/dev/null/x"],
    ["runs", "--runs", "RUN/.."],
)


@settings(max_examples=60)
@given(data=st.data(), name=st.sampled_from([LOG, MANIFEST]))
def test_a_log_or_manifest_with_flipped_or_lost_bytes_gets_a_sentence(
    small: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, name: str
) -> None:
    whole = bytearray((small / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 3), label="damages")):
        at = data.draw(st.integers(0, len(whole) - 1), label="at")
        what = data.draw(st.sampled_from(["flip", "cut", "drop", "digit"]), label="what")
        if what == "flip":
            whole[at] ^= 1 << data.draw(st.integers(0, 7), label="bit")
        elif what == "digit":
            whole[at : at + 1] = b"999999999999"
        elif what == "drop":
            del whole[at : at + data.draw(st.integers(1, 40), label="bytes")]
        else:
            del whole[at:]
        if not whole:
            break
    folder = tmp_path_factory.mktemp("damaged") / "run"
    shutil.copytree(small, folder)
    (folder / name).write_bytes(bytes(whole))
    calm(folder, commands=COMMANDS)
    shutil.rmtree(folder.parent)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@given(data=st.data(), value=json_values)
def test_a_column_of_any_other_kind_is_read_or_refused(small: Path, data: st.DataObject, value: Any) -> None:
    row = json.loads((small / LOG).read_text().splitlines()[3])
    row[data.draw(st.sampled_from(sorted(row)))] = value
    try:
        tick = tick_of(row)
    except RecordingError:
        return
    assert json.loads(tick.line())["t"] == pytest.approx(row["t"])  # what was taken can be written again


@settings(max_examples=25)
@given(data=st.data(), value=json_values)
def test_a_manifest_with_an_entry_of_any_other_kind_is_read_or_refused(
    small: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, value: Any
) -> None:
    manifest = json.loads((small / MANIFEST).read_bytes())
    where: Any = manifest
    while True:  # somewhere down the tree
        key = data.draw(st.sampled_from(sorted(where) if isinstance(where, dict) else range(len(where))))
        if isinstance(where[key], (dict, list)) and where[key] and data.draw(st.booleans()):
            where = where[key]
        else:
            where[key] = value
            break
    folder = tmp_path_factory.mktemp("damaged") / "run"
    shutil.copytree(small, folder)
    (folder / MANIFEST).write_text(json.dumps(manifest))
    calm(folder, commands=COMMANDS)
    try:
        found = find(folder, folder)
    except RecordingError:
        return
    remake(found.folder)  # what the reader lets through the viewer can show
    shutil.rmtree(folder.parent)


def test_a_log_cut_at_every_kind_of_place(small: Path, tmp_path: Path) -> None:
    whole = (small / LOG).read_bytes()
    line = whole.index(b"\n") + 1
    places = [0, 1, line - 1, line, line + 1, line + 30, len(whole) // 2, len(whole) - 1, len(whole)]
    places += [whole.index(mark) for mark in (b'"raw"', b"n,", b'"u"', b"[", b"}")]
    shutil.copytree(small, tmp_path / "run")
    for cut in places:
        (tmp_path / "run" / LOG).write_bytes(whole[:cut])
        ticks = [tick.tick for tick in find(tmp_path / "run", tmp_path).ticks()]
        assert ticks == list(range(whole[:cut].count(b"\n"))), "the whole lines, and no more"
        calm(tmp_path / "run", commands=COMMANDS)
    (tmp_path / "run" / LOG).unlink()
    calm(tmp_path / "run", commands=COMMANDS)


def test_nothing_in_a_folder_is_run_or_unpickled(copy: Path, tmp_path: Path, say: Callable[..., Any]) -> None:
    import pickle

    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "sprung",))

    for name in (LOG, MANIFEST, FILE):
        folder = tmp_path / f"trap-{name}"
        shutil.copytree(copy, folder)
        (folder / name).write_bytes(pickle.dumps(Trap()))
        (folder / "conftest.py").write_text(f"open({str(tmp_path / 'sprung')!r}, 'w')")
        calm(folder, commands=COMMANDS)
        damage(folder / FILE)
    assert not (tmp_path / "sprung").exists()


def test_a_line_without_end_and_what_is_no_file_in_the_logs_place_are_refused(
    copy: Path, say: Callable[..., Any]
) -> None:
    with (copy / LOG).open("ab") as log:
        log.write(b'"' * (3 << 20))
    said = say("replay", copy)
    assert said.code == 6
    assert "line 121 is damaged: it has no end" in said.err
    for make in (os.mkdir, os.mkfifo, lambda path: os.symlink("/dev/zero", path)):
        (copy / LOG).rmdir() if (copy / LOG).is_dir() else (copy / LOG).unlink()
        make(copy / LOG)
        said = say("replay", copy)
        assert said.code == 6
        assert "cannot be read" in said.err
        assert say("runs", "--runs", copy.parent).code == 0


@pytest.fixture(scope="module")
def viewers_file(small: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("rrd")
    (made,) = remake(small, into=folder)
    return made.read_bytes()


def test_a_whole_viewers_file_is_whole(viewers_file: bytes, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(viewers_file)
    assert damage(tmp_path / FILE) is None


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 1.0])
def test_a_viewers_file_that_was_cut_is_damaged(viewers_file: bytes, tmp_path: Path, share: float) -> None:
    (tmp_path / FILE).write_bytes(viewers_file[: int(share * (len(viewers_file) - 1))])
    assert damage(tmp_path / FILE)


def test_a_foreign_file_is_no_viewers_file(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"\x89PNG" + bytes(1000))
    assert damage(tmp_path / FILE) == "it is no viewer's file"
    assert damage(tmp_path / "missing") is not None


def test_what_makes_the_reader_abort_is_damage_too(viewers_file: bytes, tmp_path: Path) -> None:
    """A zero in the name of a column ends the whole process that reads it."""
    broken = viewers_file.replace(b"tick", b"ti\x00k")
    assert broken != viewers_file
    (tmp_path / FILE).write_bytes(broken)
    assert damage(tmp_path / FILE)


@pytest.mark.parametrize("kilobytes", [16, 128])
def test_where_there_is_no_room_for_the_viewers_file_that_is_said_and_the_command_ends(
    copy: Path, kilobytes: int
) -> None:
    """rerun itself would wait for ever for a writer that has died."""
    limit = kilobytes << 10
    done = subprocess.run(
        [sys.executable, "-m", "khepera_hil", "review", copy, "--picture", copy / "p.png"],
        cwd=copy,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert done.returncode == 6, done.stderr
    assert "the viewer's file cannot be written in" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in copy.iterdir()) == [MANIFEST, LOG], "nothing half is left"


def test_a_run_for_whose_folder_there_is_no_room_leaves_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("khepera_hil.recording.os.fsync", full)
    with pytest.raises(RecordingError, match="No space left on device; choose a folder"):
        Recording.create(tmp_path, program="home", seed=1, manifest={}, started=STARTED)
    assert list(tmp_path.iterdir()) == []
