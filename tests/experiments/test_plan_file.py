"""Plans: words of the command line in a file, and nothing else."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from khepera_hil.commands import paper
from khepera_hil.commands.plan_file import HOW, planned
from khepera_hil.errors import UsageError
from tests.runs.cli import khepera_hil

PARSER = paper._parser()


def asked(text: str, folder: Path, *words: str) -> dict[str, object]:
    path = folder / "plan.toml"
    path.write_text(text)
    return vars(planned(PARSER, path, ["--plan", str(path), *words]))


def test_a_plan_says_what_words_say_and_words_beside_it_go_before(tmp_path: Path) -> None:
    plan = """
        experiments = ["watchman", "push"]
        out = "elsewhere"
        seeds = { first = 7, count = 30 }
        [settings]
        hours = 30
        days = 10
        nights = 100
    """
    words = ["watchman", "push", "--out=elsewhere", "--first=7", "--seeds=30", "--hours=30", "--days=10"]
    words += ["--nights=100"]
    expected = vars(PARSER.parse_args(words))
    assert asked(plan, tmp_path) == {**expected, "plan": tmp_path / "plan.toml"}
    beside = asked(plan, tmp_path, "avoid", "--seeds", "2", "--out", "here", "--hours", "0.5")
    changes = {"names": ["avoid"], "seeds": 2, "out": Path("here"), "hours": 0.5}
    assert beside == {**expected, "plan": tmp_path / "plan.toml", **changes}


def test_what_is_saved_says_the_same(tmp_path: Path) -> None:
    words = ["watchman", "avoid", "--hours", "1.5", "--first", "3", "--record", 'a "folder"', "--out", "ä\\b"]
    done = khepera_hil("paper", *words, "--save-plan", "plan.toml", "--jobs", "2", cwd=tmp_path)
    assert done.code == 0, done.err
    assert "khepera-hil paper --plan plan.toml" in done.out
    text = (tmp_path / "plan.toml").read_text()
    found = planned(PARSER, tmp_path / "plan.toml", [])
    expected = PARSER.parse_args(words)
    assert vars(found) == vars(expected)
    assert tomllib.loads(text)["settings"] == {"hours": 1.5, "record": 'a "folder"'}
    again = khepera_hil("paper", *words, "--save-plan", "plan.toml", cwd=tmp_path)
    assert again.code == 2
    assert "plan.toml is there already" in again.err
    assert (tmp_path / "plan.toml").read_text() == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "it does not say which experiments"),
        ("experiments = []", "it does not say which experiments"),
        ("experiments = 'push'", "it does not say which experiments"),
        ("experiments = [1]", "it does not say which experiments"),
        (
            "experiments = ['push']\nseed = 3",
            "there is no 'seed' in the plan; there are experiments, out, seeds, set",
        ),
        ("experiments = ['push']\njobs = 3", "there is no 'jobs' in the plan"),
        ("experiments = ['push']\nseeds = 3", "seeds is a table of its own"),
        ("experiments = ['push']\nseeds.number = 3", "there is no 'number' in [seeds]; there are count, first"),
        ("experiments = ['push']\nseeds.count = 0", "'0' is no number from 1 to 100000"),
        ("experiments = ['push']\nseeds.count = 1.5", "'1.5' is no number from 1 to 100000"),
        ("experiments = ['push']\nseeds.count = true", "seeds: count is a number or a text, and not True"),
        ("experiments = ['push']\n[settings]\nhour = 3", "there is no 'hour' in [settings]; there are "),
        ("experiments = ['push']\n[settings]\nhours = 'long'", "'long' is no number of hours from 0"),
        ("experiments = ['push']\n[settings]\nhours = [1, 2]", "hours is a number or a text, and not [1, 2]"),
        ("experiments = ['push']\n[settings]\nhours = nan", "'nan' is no number of hours"),
        ("experiments = ['push']\n[settings]\njobs = 3", "there is no 'jobs' in [settings]"),
        ("experiments = ['push']\nout = 3.5\n[settings]\nhours = {a = 1}", "hours is a number or a text"),
        ("experiments = [", "no TOML file: "),
        ("\0", "no TOML file: "),
        ("a = " + "[" * 5000, "no TOML file: "),
    ],
)
def test_nonsense_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(UsageError) as raised:
        asked(text, tmp_path)
    assert said in str(raised.value)
    assert str(raised.value).startswith(f"{tmp_path / 'plan.toml'}: ")
    assert "\n" not in str(raised.value)


def test_a_plan_that_is_not_there_or_no_text_or_names_what_there_is_not(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the plan cannot be read: No such file"):
        planned(PARSER, tmp_path / "none.toml", [])
    with pytest.raises(UsageError, match="the plan cannot be read: Is a directory"):
        planned(PARSER, tmp_path, [])
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match="no TOML file"):
        planned(PARSER, tmp_path / "binary.toml", [])
    (tmp_path / "chess.toml").write_text('experiments = ["chess", "--json"]')
    done = khepera_hil("paper", "--plan", "chess.toml", cwd=tmp_path)
    assert done.code == 2
    assert "there is no experiment 'chess'" in done.err


def test_how_it_is_run_is_not_the_plans_to_say() -> None:
    """Every option that is not named so is a setting: this fails when one of them was renamed."""
    dests = {action.dest for action in PARSER._actions}
    assert dests >= HOW - {"markdown"}


def test_a_plan_is_run_and_goes_on(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text('experiments = ["phototaxy"]\nout = "here"\nseeds.count = 1\n')
    first = khepera_hil("paper", "--plan", "plan.toml", "--no-show", "--json", cwd=tmp_path)
    assert first.code == 0, first.err
    (results,) = (tmp_path / "here/phototaxy").glob("results-*.parquet")
    again = khepera_hil("paper", "--plan", "plan.toml", "--no-show", "--json", cwd=tmp_path)
    assert again.result == first.result
    assert " of 2 trials" not in again.err, "nothing was measured"
    assert results.exists()
