"""A plan: what ``khepera-hil paper`` is to run, as a small TOML file instead of words.

    experiments = ["watchman"]     # or ["all"]
    out = "runs/fair"              # as --out

    [seeds]
    first = 1
    count = 100

    [settings]                     # the experiments' own options, by their names without the dashes
    hours = 30
    nights = 100

A plan stands for words of the command line and is read as if they stood there: there is one notion of what may be
asked, and one sentence for each mistake. How it is run (``--jobs``, ``--scheduler``) is not the plan's to say.
"""

from __future__ import annotations

import argparse
import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from khepera_hil.commands.parser import Parser
from khepera_hil.errors import UsageError

__all__ = ["HOW", "planned", "saved"]

HOW = {"help", "list", "plan", "save_plan", "jobs", "scheduler", "fresh", "no_show", "json", "markdown"}
"""Options of how to run and what to print, by what argparse calls them; no plan has them."""

_TOP = {"names": "experiments", "out": "out"}
_SEEDS = {"first": "first", "seeds": "count"}


def planned(parser: Parser, path: Path, arguments: Sequence[str]) -> argparse.Namespace:
    """What is asked by the plan and by the words beside it, which go before it. Raises UsageError."""
    try:
        base = parser.parse_args(_words(parser, _content(path)))
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    names = base.names
    asked = parser.parse_args(arguments, base)
    asked.names = asked.names or names
    return asked


def saved(parser: Parser, asked: argparse.Namespace, path: Path) -> None:
    """Write the plan that stands for the same. Raises UsageError where there is a file, or none can be."""
    lines = [f"experiments = {_toml(asked.names)}", f"out = {_toml(asked.out)}", "", "[seeds]"]
    lines += [f"{key} = {_toml(getattr(asked, name))}" for name, key in _SEEDS.items()]
    settings = {
        key: value
        for key, action in _settings(parser).items()
        if (value := getattr(asked, action.dest)) != action.default
    }
    if settings:
        lines += ["", "[settings]", *(f"{key} = {_toml(value)}" for key, value in settings.items())]
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")
    except FileExistsError:
        raise UsageError(f"{path} is there already; remove it, or give the plan another name") from None
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from None


def _content(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise UsageError(f"the plan cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise UsageError(f"no TOML file: {error}") from None


def _words(parser: Parser, plan: Mapping[str, Any]) -> list[str]:
    _known("the plan", plan, [*_TOP.values(), "seeds", "settings"])
    seeds, settings = _part(plan, "seeds"), _part(plan, "settings")
    _known("[seeds]", seeds, _SEEDS.values())
    options = _settings(parser)
    _known("[settings]", settings, options)
    words: list[str] = []
    for name, key in _SEEDS.items():
        if key in seeds:
            words += [f"--{name}={_plain(f'seeds: {key}', seeds[key])}"]
    if "out" in plan:
        words += [f"--out={_plain('out', plan['out'])}"]
    for key, value in settings.items():
        words += _option(key, value, options[key])
    names = plan.get("experiments")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        raise UsageError('it does not say which experiments: experiments = ["push", "avoid"], or ["all"]')
    return [*words, "--", *names]


def _option(key: str, value: object, action: argparse.Action) -> list[str]:
    if action.nargs == 0:  # a switch
        if not isinstance(value, bool):
            raise UsageError(f"{key} is true or false, and not {value!r}")
        return [f"--{key}"] if value else []
    several = isinstance(action, argparse._AppendAction)
    values = value if several and isinstance(value, list) else [value]
    return [f"--{key}={_plain(key, one)}" for one in values]


def _settings(parser: Parser) -> dict[str, argparse.Action]:
    """The options that are settings, by their names without the dashes."""
    taken = {*HOW, *_TOP, *_SEEDS}
    return {
        action.option_strings[-1].removeprefix("--"): action
        for action in parser._actions
        if action.option_strings and action.dest not in taken
    }


def _known(where: str, table: Mapping[str, Any], keys: Iterable[str]) -> None:
    keys = sorted(keys)
    for key in table:
        if key not in keys:
            raise UsageError(f"there is no {key!r} in {where}; there are {', '.join(keys)}")


def _part(plan: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    part = plan.get(name, {})
    if not isinstance(part, dict):
        raise UsageError(f"{name} is a table of its own: [{name}], and its keys below it")
    return part


def _plain(key: str, value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise UsageError(f"{key} is a number or a text, and not {value!r}")
    return str(value)


def _toml(value: object) -> str:
    """A value as TOML has it: what argparse gives are numbers, truths, texts, paths and lists of them."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, (bool, int, float)):
        return json.dumps(value)
    return json.dumps(str(value), ensure_ascii=False)
