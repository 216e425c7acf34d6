"""Which code a trial's results depend on, as one short hash: other code, and they are measured anew.

Counted are all modules of ours that a trial's module can import, at its top or late inside a function, and what
those import in turn, with the packages that they are in; a module's name in a text, such as the one that pyserial
gets to look for ports in, stands for all that is in it. Where a module imports what only the run can tell, all of
ours counts. So do all arenas and data of both packages, Python's version, and those of the libraries.

A process remembers what a file was when it was first looked at, since that is what it has loaded, or will load,
unless the file is changed meanwhile; :meth:`Code.changed` tells.
"""

from __future__ import annotations

import ast
import hashlib
import re
import sys
from collections.abc import Iterator, Set
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path

__all__ = ["Code", "code_of"]

_OURS = ("brp", "khepera_hil")
_DATA = {".toml", ".json"}
_BY_THE_RUN = {
    "__import__",
    "exec_module",
    "import_module",
    "iter_modules",
    "run_module",
    "run_path",
    "spec_from_file_location",
    "walk_packages",
}
"""By what a module imports what cannot be read off its text."""

_DOTTED = re.compile(r"\w+(\.\w+)+", re.ASCII)
"""What may be the name of a module."""

_EVALUATES = {"eval", "exec"}
_IMPORTS = re.compile(r"(^|[\n;])\s*(import|from)\s+\w|__import__")
"""In a text that is evaluated, a piece that would import."""


@dataclass(frozen=True)
class Code:
    """What a module's results depend on."""

    digest: str
    modules: frozenset[str]
    """Of ours."""
    files: tuple[Path, ...]

    def changed(self) -> Path | None:
        """A file that is no longer what it was when this process first looked at it."""
        return next((path for path in self.files if _first(path).moved()), None)


@cache
def code_of(module: str) -> Code:
    """Of a trial's module."""
    root = module.partition(".")[0]
    roots = tuple(dict.fromkeys((*_OURS, root)))
    modules, foreign = _reached(module, roots)
    digest = hashlib.blake2b(digest_size=8)
    files: dict[str, Path] = {name: path for name in modules if (path := _file(name)) is not None}
    for name in _OURS:
        folder = _folder(name)
        files |= {f"{name}/{path.relative_to(folder)}": path for path in folder.rglob("*") if path.suffix in _DATA}
    for name, path in sorted(files.items()):
        digest.update(f"{name} {_first(path).digest}\n".encode())
    for line in (f"python {sys.version_info.major}.{sys.version_info.minor}", *sorted(_versions(foreign))):
        digest.update(f"{line}\n".encode())
    return Code(digest.hexdigest(), frozenset(modules), tuple(files[name] for name in sorted(files)))


def _reached(module: str, roots: tuple[str, ...]) -> tuple[Set[str], Set[str]]:
    """Modules of these packages, and the first names of all others but Python's own."""
    reached: set[str] = set()
    foreign: set[str] = set()
    texts: dict[str, set[str]] = {root: set() for root in roots}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        root = name.partition(".")[0]
        if name in reached:
            continue
        if root not in roots:
            foreign.add(root)
            continue
        if (path := _file(name)) is None:
            continue  # a function's or a class's name
        reached.add(name)
        if "." in name:
            waiting.append(name.rpartition(".")[0])
        file = _parsed(path)
        waiting += file.imported(name)
        waiting += (one for text in file.names if text.partition(".")[0] in roots for one in _all(text))
        # What is evaluated is made of the texts of its own package: one of them would have to import.
        texts[root] |= file.evaluated
        if file.by_the_run or texts[root] >= {"evaluates", "imports"}:
            waiting += (one for root in roots for one in _all(root))
    return reached, foreign - sys.stdlib_module_names


@dataclass(frozen=True)
class _Parsed:
    """What is in a module's text: ``(level, from, name)`` of its imports, texts that may be modules' names."""

    path: Path
    imports: tuple[tuple[int, str, str], ...]
    names: frozenset[str]
    by_the_run: bool
    evaluated: frozenset[str]
    """Of ``evaluates`` and ``imports``: whether it evaluates a text, whether it has one that would import."""

    def imported(self, module: str) -> Iterator[str]:
        package = module if self.path.name == "__init__.py" else module.rpartition(".")[0]
        parts = package.split(".")
        for level, of, name in self.imports:
            base = ".".join(parts[: len(parts) - level + 1] if level else ())
            source = ".".join(filter(None, (base, of)))
            yield source
            yield f"{source}.{name}" if name else source


@cache
def _parsed(path: Path) -> _Parsed:
    imports: list[tuple[int, str, str]] = []
    names: set[str] = set()
    evaluated: set[str] = set()
    by_the_run = False
    said: set[int] = set()  # docstrings, which nothing evaluates
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Expr):
            said.add(id(node.value))
        elif isinstance(node, ast.Import):
            imports += ((0, alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            imports += ((node.level, node.module or "", alias.name) for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if _DOTTED.fullmatch(node.value):
                names.add(node.value)
            if _IMPORTS.search(node.value) and id(node) not in said:
                evaluated.add("imports")
        elif isinstance(node, (ast.Name, ast.Attribute)):
            by = node.id if isinstance(node, ast.Name) else node.attr
            by_the_run = by_the_run or by in _BY_THE_RUN
            if by in _EVALUATES:
                evaluated.add("evaluates")
    return _Parsed(path, tuple(imports), frozenset(names), by_the_run, frozenset(evaluated))


def _all(name: str) -> list[str]:
    """A module, and all that is in it if it is a package."""
    path = _file(name)
    if path is None:
        return []
    if path.name != "__init__.py":
        return [name]
    below = (found.relative_to(path.parent).with_suffix("").parts for found in path.parent.rglob("*.py"))
    return [".".join((name, *(part for part in parts if part != "__init__"))) for parts in below]


@cache
def _file(module: str) -> Path | None:
    """Where the source of a module of ours is; nothing is imported to find it."""
    root, *parts = module.split(".")
    if root == "__main__":
        found = getattr(sys.modules["__main__"], "__file__", None)
        return Path(found) if found and not parts else None
    if not all(part.isidentifier() for part in (root, *parts)):
        return None
    folder = _folder(root)
    if not parts and folder.is_file():
        return folder
    for path in (folder.joinpath(*parts, "__init__.py"), folder.joinpath(*parts).with_suffix(".py")):
        if path.is_file() and (parts or path.name == "__init__.py"):
            return path
    return None


@cache
def _folder(root: str) -> Path:
    """Of a package that is at the top; of a module there, its file."""
    spec = find_spec(root)
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    return Path(spec.origin if spec is not None and spec.origin else root)


def _versions(names: Set[str]) -> Iterator[str]:
    distributions = packages_distributions()
    for distribution in {one for name in names for one in distributions.get(name, ())}:
        try:
            yield f"{distribution} {version(distribution)}"
        except PackageNotFoundError:  # half of it was removed
            yield distribution


@dataclass(frozen=True)
class _First:
    """A file as it was when this process first looked at it."""

    path: Path
    stamp: tuple[int, int]
    digest: str

    def moved(self) -> bool:
        try:
            return _stamp(self.path) != self.stamp and _digest(self.path) != self.digest
        except OSError:
            return True


@cache
def _first(path: Path) -> _First:
    return _First(path, _stamp(path), _digest(path))


def _stamp(path: Path) -> tuple[int, int]:
    seen = path.stat()
    return seen.st_mtime_ns, seen.st_size


def _digest(path: Path) -> str:
    return hashlib.blake2b(path.read_bytes(), digest_size=8).hexdigest()
