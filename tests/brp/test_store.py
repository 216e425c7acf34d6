"""Files: what is loaded is what was saved, any program can read it, and nothing damaged or hostile gets in."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from brp import (
    BrpError,
    Dirac,
    Gaussian,
    Histogram,
    Laplace,
    P,
    Specification,
    StoreError,
    Switch,
    Uniform,
    Variable,
)
from brp.store import load, load_data, save, save_data
from tests.brp.campaign import examples

Dir = Variable("Dir", range(-4, 5, 2))
H = Variable("H", ("avoidance", "phototaxy"))
Vrot = Variable("Vrot", range(-3, 4))
Light = Variable("Light", (0.5, 1.25, 8.0))
Behavior = Variable("Behavior_t-1", (True, False))

specification = Specification(
    {
        P(Dir): Uniform(),
        P(H | Dir): Laplace(),
        P(Light): Gaussian(unvisited="uniform"),
        P(Behavior | H): Histogram(),
        P(Vrot | Dir, H): Switch(H, {"avoidance": Gaussian(), "phototaxy": Dirac(lambda Dir: Dir // 2)}),
    },
    name="pi-é",
)
rng = np.random.default_rng(0)
DATA: dict[str, list[Any]] = {
    v.name: [v.values[int(place)] for place in rng.integers(0, len(v), 60)] for v in specification.variables
}
learnt = specification.identify(DATA, name="delta-push")


def test_what_is_loaded_answers_and_learns_as_what_was_saved(tmp_path: Path) -> None:
    save(learnt, tmp_path / "push.json")
    loaded = load(tmp_path / "push.json", specification)
    assert str(loaded) == "delta-push pi-é"
    datum = {name: column[0] for name, column in DATA.items()}
    for before, after in ((learnt, loaded), (learnt.learn(datum), loaded.learn(datum))):
        for term in (P(Vrot | Dir, H), P(H | Dir, Vrot, Light), P(Behavior), P(Light)):
            one, other = before.ask(term), after.ask(term)
            known = {v.keyword: v.values[1] for v in term.given}
            np.testing.assert_array_equal(one(**known).p, other(**known).p)
    assert [path.name for path in tmp_path.iterdir()] == ["push.json"]


def test_another_program_reads_the_file_by_its_description(tmp_path: Path) -> None:
    """Only json here: mean = origin + first / count."""
    save(learnt, tmp_path / "push.json")
    file = json.loads((tmp_path / "push.json").read_text(encoding="utf-8"))
    assert (file["format"], file["version"], file["data"]) == ("brp description", 1, "delta-push")
    assert file["variables"]["Dir"] == {"from": -4, "step": 2, "count": 5}
    by_term = {(*entry["of"], "|", *entry["given"]): entry["form"] for entry in file["terms"]}
    light = by_term["Light", "|"]
    assert light["origin"] + light["first"] / light["count"] == pytest.approx(np.mean(DATA["Light"]))
    turn = by_term["Vrot", "|", "Dir", "H"]["cases"][0]
    cell = [
        vrot
        for vrot, turned, h in zip(DATA["Vrot"], DATA["Dir"], DATA["H"], strict=True)
        if (turned, h) == (0, "avoidance")
    ]
    assert turn["origin"] + turn["first"][2] / turn["count"][2] == pytest.approx(np.mean(cell))


def test_a_data_set_is_loaded_as_it_was_saved(tmp_path: Path) -> None:
    rows = [dict(zip(DATA, values, strict=True)) for values in zip(*DATA.values(), strict=True)]
    save_data(rows, specification.variables, tmp_path / "data.json", name="delta-push")
    assert load_data(tmp_path / "data.json", specification.variables) == ("delta-push", DATA)
    assert load_data(tmp_path / "data.json", [H])[1] == {"H": DATA["H"]}
    with pytest.raises(StoreError, match=r"values of Dir .* is wanted"):
        load_data(tmp_path / "data.json", [Variable("Dir", range(4))])
    with pytest.raises(StoreError, match="there is no Foo"):
        load_data(tmp_path / "data.json", [Variable("Foo", range(4))])
    text = (tmp_path / "data.json").read_text(encoding="utf-8").replace('"avoidance"', '"sleep"', 3)
    text = text.replace('"sleep"', '"avoidance"', 1)
    (tmp_path / "bad.json").write_text(text, encoding="utf-8")
    with pytest.raises(StoreError, match="H = 'sleep' is not one of its values"):
        load_data(tmp_path / "bad.json", [H])


def test_what_was_written_by_hand_is_named_again(tmp_path: Path) -> None:
    simple = Specification({P(Dir): Uniform(), P(Vrot | Dir): Gaussian()}, name="pi")
    hand = {P(Vrot | Dir): Gaussian(lambda Dir: Dir / 2, 1)}
    save(simple.identify(parameters=hand), tmp_path / "hand.json")
    with pytest.raises(StoreError, match="written by hand; name it again"):
        load(tmp_path / "hand.json", simple)
    assert load(tmp_path / "hand.json", simple, parameters=hand).ask(P(Vrot | Dir))(Dir=4).best() == 2


def test_another_specification_is_refused(tmp_path: Path) -> None:
    save(learnt, tmp_path / "push.json")
    forms = dict(specification.forms)
    with pytest.raises(StoreError, match="its specification is"):
        load(tmp_path / "push.json", Specification(forms, name="pi-other"))
    forms[P(Light)] = Laplace()
    with pytest.raises(StoreError, match='its form is "Gaussian", and "Laplace" is wanted'):
        load(tmp_path / "push.json", Specification(forms, name="pi-é"))
    forms[P(Light)] = Uniform()
    with pytest.raises(StoreError, match="variables"):
        load(tmp_path / "push.json", Specification(forms, name="pi-é"))


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (lambda text: text[: len(text) // 2], "is damaged"),
        (lambda text: "", "is damaged"),
        (lambda text: "[" * 100_000, "is damaged"),
        (lambda text: "[]", "there is no format"),
        (lambda text: text.replace('"version": 1', '"version": 2'), "its version is 2, and 1 is wanted"),
        (lambda text: text.replace('"version": 1', '"version": true'), "its version is true"),
        (lambda text: text.replace('"origin": 0.0', '"origin": NaN', 1), "it holds NaN"),
        (lambda text: text.replace('"data"', '"version": 1, "data"', 1), "a name stands twice"),
        (lambda text: text.replace('"count": [', '"count": [-', 1), "which cannot be"),
        (lambda text: text.replace('"count": [', '"count": [1e999, ', 1), "not the shape|cannot be"),
        (lambda text: text.replace('"count": [', '"count": ["__import__(\'os\')", ', 1), "shape|no number"),
        (lambda text: text.replace('"second": [', '"second": [0, ', 1), "not the shape"),
        (lambda text: text.replace('"delta-push"', "3"), "its data is no text"),
    ],
)
def test_a_damaged_file_is_refused_with_a_sentence(damage: Any, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "push.json"
    save(learnt, path)
    text = path.read_text(encoding="utf-8")
    damaged = damage(text)
    assert damaged != text
    path.write_text(damaged, encoding="utf-8")
    with pytest.raises(StoreError, match=sentence) as refused:
        load(path, specification)
    assert "push.json" in str(refused.value)


@examples(150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_no_change_of_a_byte_makes_anything_but_a_description_or_a_sentence(
    tmp_path: Path, data: st.DataObject
) -> None:
    path = tmp_path / "push.json"
    save(learnt, path)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    with suppress(BrpError):
        loaded = load(path, specification)
        assert loaded.ask(P(Vrot | Dir, H))(Dir=0, H="avoidance").p.sum() == pytest.approx(1)


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "push.json"
    save(learnt, path)
    before = path.read_bytes()
    broken = Specification({P(Light): Laplace()}).identify({"Light": [0.5]}, name="\ud800")
    with pytest.raises(UnicodeEncodeError):
        save(broken, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["push.json"]
