"""Identified descriptions and data sets as plain files: JSON that any program can read, and nothing that is run.

A description's file holds what data have identified; the specification itself is a program and stays one. It reads

    {"format": "brp description", "version": 1, "specification": "pi-obstacle", "data": "delta-push",
     "variables": {"Dir": {"from": -10, "step": 1, "count": 21}, "H": {"values": ["avoidance", "phototaxy"]}, ...},
     "terms": [{"of": ["Vrot"], "given": ["Dir", "Prox"], "form": FORM}, ...]}

with one entry for each term that has free parameters. FORM is one of

    {"form": "Gaussian", "origin": 0, "count": ARRAY, "first": ARRAY, "second": ARRAY}
        for each cell the number of samples and the sums of (value - origin) and of its square;
        mean = origin + first / count, variance = second / count - (first / count)^2
    {"form": "Laplace" or "Histogram", "bins": number or null, "counts": ARRAY}
        an axis for the values left of the bar (or their bins), then one for each given variable
    {"form": "Switch", "variable": "H", "cases": [FORM, ...]}     in the specification's order
    {"form": "given"}    written by hand, to be named again when the file is loaded, or in need of no data

An ARRAY is nested lists, an axis for each given variable in the term's order. A data set's file is

    {"format": "brp data", "version": 1, "name": "delta-push", "variables": ..., "columns": {"Dir": [...], ...}}
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.counts import Counted, Counting
from brp.description import Description, Specification
from brp.errors import BrpError, StoreError
from brp.forms import Form, Switch
from brp.gaussian import Gaussian, Taught
from brp.samples import Data, Samples
from brp.variables import Term, Variable, text

__all__ = ["load", "load_data", "save", "save_data"]

VERSION = 1
LARGEST = 256_000_000
"""The bytes that a file may have."""

Json = Any
"""What `json` makes of a file, not yet looked at."""


def save(description: Description, path: str | Path) -> None:
    """Write what was identified to ``path``, in one step: a crash leaves the old file or the new one."""
    specification = description.specification
    terms = [
        {
            "of": [v.name for v in term.of],
            "given": [v.name for v in term.given],
            "form": _written(description[term], term),
        }
        for term in specification.free
    ]
    variables = [v for v in specification.variables if any(v in term.variables for term in specification.free)]
    _write(
        path,
        {
            "format": "brp description",
            "version": VERSION,
            "specification": specification.name,
            "data": description.name,
            "variables": _domains(variables),
            "terms": terms,
        },
    )


def load(
    path: str | Path, specification: Specification, *, parameters: Mapping[Term, Form] | None = None
) -> Description:
    """The description that `save` wrote, of the same specification.

    ``parameters`` names again what was written by hand. Raises `StoreError` for a file that is damaged, of another
    version, or made with another specification, and OSError when it cannot be read.
    """
    file = _read(path, "brp description")
    _same(path, "specification", _text(path, file, "specification"), specification.name)
    given = dict(parameters or {})
    for term in given:
        if term not in specification.free:
            raise StoreError(f"{term} of {specification} has no free parameters that could be given")
    needed = [v for v in specification.variables if any(v in term.variables for term in specification.free)]
    _same(path, "variables", _at(path, file, "variables"), _domains(needed))
    entries = _at(path, file, "terms")
    wanted = [{"of": [v.name for v in t.of], "given": [v.name for v in t.given]} for t in specification.free]
    if not isinstance(entries, list) or len(entries) != len(wanted):
        raise StoreError(f"{path} has not one entry for each of {text(specification.free)}")
    forms = dict(specification.forms)
    for term, entry, names in zip(specification.free, entries, wanted, strict=True):
        for side in ("of", "given"):
            _same(path, f"{side} in the entry for {term}", _at(path, entry, side), names[side])
        where = f"{path}, in {term}"
        found = _at(where, entry, "form")
        if term in given:
            forms[term] = given[term]
        else:
            forms[term] = _read_form(where, found, specification.forms[term], term)
    return Description(specification, forms, _text(path, file, "data"))


def save_data(data: Data, variables: Iterable[Variable], path: str | Path, *, name: str = "") -> None:
    """Write a data set, columns or rows, to ``path``; every variable needs a column, and every value must fit."""
    chosen = list(variables)
    samples = Samples.of(data, chosen)
    columns = {v.name: [v.values[place] for place in samples[v].tolist()] for v in chosen}
    _write(
        path,
        {
            "format": "brp data",
            "version": VERSION,
            "name": name,
            "variables": _domains(chosen),
            "columns": columns,
        },
    )


def load_data(path: str | Path, variables: Iterable[Variable]) -> tuple[str, dict[str, list[Any]]]:
    """The name and the columns of a data set that has these variables: what ``identify`` takes.

    Raises `StoreError` when the file is damaged or does not fit the variables, and OSError.
    """
    file = _read(path, "brp data")
    chosen = list(variables)
    domains, columns = _at(path, file, "variables"), _at(path, file, "columns")
    read: dict[str, list[Any]] = {}
    for variable, domain in _domains(chosen).items():
        _same(path, f"values of {variable}", _at(path, domains, variable), domain)
        column = _at(path, columns, variable)
        if not isinstance(column, list):
            raise StoreError(f"{path}: the column of {variable} is no list")
        read[variable] = column
    try:
        Samples.of(read, chosen)
    except BrpError as error:
        raise StoreError(f"{path}: {error}") from None
    return _text(path, file, "name"), read


def _written(form: Form, term: Term) -> Json:
    match form:
        case Taught():
            numbers = {"count": form.count, "first": form.first, "second": form.second}
            arrays = {name: array.tolist() for name, array in numbers.items()}
            return {"form": "Gaussian", "origin": form.origin(term), **arrays}
        case Counted():
            return {"form": type(form.form).__name__, "bins": form.form.bins, "counts": form.counts.tolist()}
        case Switch():
            within = form.within(term)
            cases = [_written(case, within) for case in form.cases.values()]
            return {"form": "Switch", "variable": form.variable.name, "cases": cases}
    return {"form": "given"}


def _read_form(where: str, entry: Json, form: Form, term: Term) -> Form:
    """The identified form that ``entry`` makes of the specification's ``form``."""
    kind = _text(where, entry, "form")
    shape = tuple(map(len, term.given))
    if not form.free:
        _same(where, "form", kind, "given")
        return form
    if kind == "given":
        raise StoreError(f"{where}: it was written by hand; name it again with load(..., parameters=)")
    wanted = "Gaussian" if isinstance(form, Gaussian) else type(form).__name__
    _same(where, "form", kind, wanted)
    if isinstance(form, Gaussian):
        count, first, second = (
            _array(where, entry, name, shape, least)
            for name, least in (("count", 0.0), ("first", None), ("second", 0.0))
        )
        taught = Taught(form, count, first, second)
        _same(where, "origin", _at(where, entry, "origin"), taught.origin(term))
        if ((count == 0) & ((first != 0) | (second != 0))).any() or (
            count * second - first**2 < -1e-6 * (1 + first**2)
        ).any():
            raise StoreError(f"{where}: no samples have such sums")
        return taught
    if isinstance(form, Counting):
        _same(where, "bins", _at(where, entry, "bins"), form.bins)
        return Counted(form, _array(where, entry, "counts", (form.size(term), *shape), 0.0))
    assert isinstance(form, Switch)
    _same(where, "variable", _text(where, entry, "variable"), form.variable.name)
    cases = _at(where, entry, "cases")
    if not isinstance(cases, list) or len(cases) != len(form.cases):
        raise StoreError(f"{where}: there is not one entry for each case of {form.variable}")
    within = form.within(term)
    read = {
        key: _read_form(f"{where}, {form.variable} = {key}", case, inner, within)
        for case, (key, inner) in zip(cases, form.cases.items(), strict=True)
    }
    return Switch(form.variable, read)


def _array(where: str, entry: Json, name: str, shape: tuple[int, ...], least: float | None) -> NDArray[np.float64]:
    """Nested lists of finite numbers of exactly this shape."""
    flat: list[float] = []

    def take(part: Json, lengths: tuple[int, ...]) -> None:
        if lengths:
            if not isinstance(part, list) or len(part) != lengths[0]:
                raise StoreError(f"{where}: {name} has not the shape {shape}")
            for inner in part:
                take(inner, lengths[1:])
        elif isinstance(part, bool) or not isinstance(part, int | float):
            raise StoreError(f"{where}: {name} holds {part!r:.40}, which is no number")
        else:
            number = float(part) if abs(part) < 1e300 else float("inf")
            if not isfinite(number) or (least is not None and number < least):
                raise StoreError(f"{where}: {name} holds {part!r:.40}, which cannot be")
            flat.append(number)

    take(_at(where, entry, name), shape)
    return np.array(flat).reshape(shape)


def _domains(variables: Iterable[Variable]) -> dict[str, Json]:
    return {
        v.name: {"from": v.values.start, "step": v.values.step, "count": len(v)}
        if isinstance(v.values, range)
        else {"values": list(v.values)}
        for v in variables
    }


def _write(path: str | Path, content: Json) -> None:
    target = Path(path)
    aside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with aside.open("w", encoding="utf-8") as file:
            json.dump(content, file, ensure_ascii=False, allow_nan=False)
            file.write("\n")
            file.flush()
            os.fsync(file.fileno())
        aside.replace(target)
    finally:
        aside.unlink(missing_ok=True)


def _read(path: str | Path, kind: str) -> Json:
    """The file as JSON, of the right kind and version; whatever else it is is refused with a sentence."""
    with Path(path).open("rb") as file:
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise StoreError(f"{path} is larger than {LARGEST / 1e6:.0f} MB, which no file of ours is")
    try:
        read = json.loads(content.decode("utf-8"), parse_constant=_no_constant, object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{path} is damaged, or no file of ours: {error}") from None
    _same(path, "format", _at(path, read, "format"), kind)
    _same(path, "version", _at(path, read, "version"), VERSION)
    return read


def _no_constant(word: str) -> None:
    raise ValueError(f"it holds {word}")


def _once(pairs: list[tuple[str, Json]]) -> dict[str, Json]:
    read = dict(pairs)
    if len(read) != len(pairs):
        raise ValueError("a name stands twice in it")
    return read


def _at(where: object, entry: Json, name: str) -> Json:
    if not isinstance(entry, dict) or name not in entry:
        raise StoreError(f"{where}: there is no {name}")
    return entry[name]


def _text(where: object, entry: Json, name: str) -> str:
    found = _at(where, entry, name)
    if not isinstance(found, str):
        raise StoreError(f"{where}: its {name} is no text")
    return found


def _same(where: object, what: str, found: Json, wanted: Json) -> None:
    """As JSON, so that true is not 1."""
    if json.dumps(found, sort_keys=True) != json.dumps(wanted, sort_keys=True):
        raise StoreError(f"{where}: its {what} is {json.dumps(found):.80}, and {json.dumps(wanted):.80} is wanted")
