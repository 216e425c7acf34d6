"""The files of a campaign's results: whole or not there, and nothing is lost in them."""

from __future__ import annotations

import json
import resource
from pathlib import Path
from typing import Any

import pyarrow as pa  # type: ignore[import-untyped]  # it ships no types
import pyarrow.parquet as pq  # type: ignore[import-untyped]
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from khepera_hil.errors import RecordingError
from khepera_hil.experiments import results as results_module
from khepera_hil.experiments.results import Results, forget, kept, parts, table_of

PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
VALUES = st.recursive(PLAIN, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=5)
OBJECTS = st.dictionaries(st.sampled_from("abc") | st.text(), VALUES, max_size=4)


def row(seed: int) -> tuple[str, str]:
    return json.dumps({"seed": seed}), json.dumps({"value": seed / 3})


@settings(max_examples=60)
@given(rows=st.lists(st.tuples(OBJECTS, OBJECTS), max_size=6), at_once=st.integers(1, 4))
def test_whatever_json_can_hold_comes_back(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[dict[str, Any], dict[str, Any]]], at_once: int
) -> None:
    folder = tmp_path_factory.mktemp("results")
    texts = [(json.dumps(case), json.dumps(result)) for case, result in rows]
    with Results(folder, "code") as results:
        for k in range(0, len(texts), at_once):
            results.keep(texts[k : k + at_once])
            assert kept(folder, "code") == dict(texts[: k + at_once])
        results.together([case for case, _ in texts])
    assert kept(folder, "code") == dict(texts)
    assert not parts(folder, "code")
    if texts:
        assert pq.read_table(table_of(folder, "code")).num_rows == len(dict(texts))


def test_columns_have_the_narrowest_kind_that_holds_them() -> None:
    values: list[dict[str, Any]] = [
        {"n": 1, "x": 1, "b": True, "t": "a", "mixed": 1, "huge": 1 << 80, "none": None},
        {"n": -1, "x": 0.5, "b": False, "mixed": "1", "huge": 1, "late": 2},
    ]
    found = results_module._columns([("{}", json.dumps(one)) for one in values], "code")
    kinds = {name: str(found.schema.field(name).type) for name in found.schema.names}
    assert kinds.items() >= {"n": "int64", "x": "double", "b": "bool", "t": "string", "late": "int64"}.items()
    assert found["x"].to_pylist() == [1.0, 0.5]
    assert found["t"].to_pylist() == ["a", None]
    assert found["mixed"].to_pylist() == ["1", '"1"']
    assert found["huge"].to_pylist() == [str(1 << 80), "1"]
    assert found.schema.metadata == {b"code": b"code"}


def test_parts_are_put_together_on_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results_module, "_PARTS", 4)
    with Results(tmp_path, "code") as results:
        for seed in range(11):
            results.keep([row(seed)])
            assert len(parts(tmp_path, "code")) == (seed + 1) % 4
    with Results(tmp_path, "code") as results:  # as after a kill: three parts are there, and stay
        results.keep([row(11)])
        assert kept(tmp_path, "code") == dict(map(row, range(12)))
    with Results(tmp_path, "code") as results:
        results.keep([row(12)])
        results.together([row(12)[0], row(3)[0]])
    seeds = pq.read_table(table_of(tmp_path, "code"))["seed"].to_pylist()
    assert seeds == [12, 3, 0, 1, 2, *range(4, 12)], "the campaign's own come first"


def test_half_a_part_costs_its_own_results(tmp_path: Path) -> None:
    with Results(tmp_path, "code") as results:
        for seed in range(3):
            results.keep([row(seed)])
    (_, broken, _) = parts(tmp_path, "code")
    broken.write_bytes(broken.read_bytes()[:100])
    (broken.parent / ".part-000004.parquet").write_bytes(b"half")
    (tmp_path / ".results-code.parquet").write_bytes(b"half")
    assert kept(tmp_path, "code") == dict([row(0), row(2)])
    with Results(tmp_path, "code") as results:
        assert results.known == dict([row(0), row(2)])
        results.keep([row(1)])
        results.together([row(seed)[0] for seed in range(3)])
    assert list(kept(tmp_path, "code").items()) == list(map(row, range(3)))
    left = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert left == [".campaign", "results-code.parquet", "results-code.parts/part-000002.damaged"]


@pytest.mark.parametrize("content", [b"", b"PAR1", b"nonsense" * 100, "half", "foreign", "no json"])
def test_a_damaged_table_is_refused_and_not_overwritten(tmp_path: Path, content: bytes | str) -> None:
    path = table_of(tmp_path, "code")
    with Results(tmp_path, "code") as results:
        results.keep([row(1)])
        results.together([])
    if content == "foreign":
        pq.write_table(pa.table({"a": [1]}), path)
    elif content == "no json":
        pq.write_table(pa.table({"case_json": ["{}"], "result_json": ["{"]}), path)
    else:
        path.write_bytes(path.read_bytes()[:-50] if isinstance(content, str) else content)
    before = path.read_bytes()
    with pytest.raises(RecordingError, match=r"is no whole table of results .*; remove it to measure anew"):
        kept(tmp_path, "code")
    with pytest.raises(RecordingError, match="is no whole table"):
        Results(tmp_path, "code")
    assert path.read_bytes() == before
    forget(tmp_path, "code")
    with Results(tmp_path, "code") as results:
        assert not results.known


def test_a_full_disk_is_told_and_takes_nothing_with_it(tmp_path: Path) -> None:
    """A file may not grow beyond a limit: the system refuses the write, as on a full disk."""
    with Results(tmp_path, "code") as results:
        results.keep([row(1)])
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
        try:
            with pytest.raises(RecordingError, match=r"results cannot be kept in .*: File too large"):
                results.keep([row(2)])
            with pytest.raises(RecordingError, match=r"results cannot be kept in .*: File too large"):
                results.together([])
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert kept(tmp_path, "code") == dict([row(1)])
        results.keep([row(2)])
        results.together([])
    assert kept(tmp_path, "code") == dict([row(1), row(2)])
    assert [path.name for path in tmp_path.iterdir() if "parquet" in path.name] == ["results-code.parquet"]


def test_two_campaigns_do_not_write_into_one_folder(tmp_path: Path) -> None:
    with Results(tmp_path, "code"), pytest.raises(RecordingError, match="another campaign is writing"):
        Results(tmp_path, "other")
    Results(tmp_path, "other").__exit__(None, None, None)
