"""The house: who may import whom (README, "The house")."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# What a module may import from ours (a package's name stands for all that is in it) and from elsewhere. Every
# file has a line, its own or its package's; the nearest one counts. The standard library is free.
TABLE: dict[str, set[str]] = {
    "khepera_hil": set(),
    # leaves
    "khepera_hil.errors": set(),
    "khepera_hil.clock": set(),
    "khepera_hil.chance": {"numpy"},
    "khepera_hil.faultspec": {"khepera_hil.errors"},
    "khepera_hil.faults": {"khepera_hil.faultspec", "numpy"},
    "khepera_hil.quantiles": set(),
    "khepera_hil.units": set(),
    "khepera_hil.fields": {"khepera_hil.errors"},
    "khepera_hil.protocol": {"khepera_hil.errors", "khepera_hil.fields", "khepera_hil.units"},
    "khepera_hil.turrets": {"khepera_hil.errors", "khepera_hil.fields"},
    "khepera_hil.lifecycle": {"statemachine"},
    "khepera_hil.systemd": set(),
    "khepera_hil.realtime": set(),
    "khepera_hil.orders": {"khepera_hil.errors"},
    # the client's end
    "khepera_hil.adapter": {"serial"},
    "khepera_hil.opening": {"khepera_hil.adapter", "khepera_hil.errors", "serial"},
    "khepera_hil.lookout": {"khepera_hil.opening", "khepera_hil.clock"},
    "khepera_hil.link": {
        "khepera_hil.lookout",
        "khepera_hil.opening",
        "khepera_hil.protocol",
        "khepera_hil.turrets",
        "khepera_hil.clock",
        "khepera_hil.errors",
    },
    "khepera_hil.plausible": {"khepera_hil.protocol"},
    "khepera_hil.khepera": {
        "khepera_hil.link",
        "khepera_hil.plausible",
        "khepera_hil.protocol",
        "khepera_hil.errors",
    },
    "khepera_hil.budget": {
        "khepera_hil.turrets",
        "khepera_hil.errors",
        "khepera_hil.perception",
        "khepera_hil.plausible",
        "khepera_hil.protocol",
    },
    "khepera_hil.transcript": {
        "khepera_hil.errors",
        "khepera_hil.perception",
        "khepera_hil.plausible",
        "khepera_hil.protocol",
    },
    "khepera_hil.reader": {
        "khepera_hil.transcript",
        "khepera_hil.budget",
        "khepera_hil.errors",
        "khepera_hil.khepera",
        "khepera_hil.perception",
        "khepera_hil.plausible",
    },
    "khepera_hil.perception": {"khepera_hil.perception", "numpy"},
    "khepera_hil.controllers": {
        "khepera_hil.controllers",
        "khepera_hil.perception",
        "khepera_hil.errors",
        "brp",
        "numpy",
    },
    "khepera_hil.scheduler": {"khepera_hil.clock"},
    "khepera_hil.keys": {"khepera_hil.orders"},
    "khepera_hil.guard": set(),  # it is run as a script, by itself
    "khepera_hil.guarding": {"khepera_hil.guard", "khepera_hil.errors"},
    "khepera_hil.wheels": {
        "khepera_hil.errors",
        "khepera_hil.guarding",
        "khepera_hil.khepera",
        "khepera_hil.lifecycle",
        "khepera_hil.opening",
    },
    "khepera_hil.reconnection": {"khepera_hil.clock", "khepera_hil.errors", "khepera_hil.khepera"},
    "khepera_hil.witness": {"khepera_hil.orders", "khepera_hil.recording"},
    "khepera_hil.conduct": {
        "brp",
        "numpy",
        "khepera_hil.controllers",
        "khepera_hil.errors",
        "khepera_hil.perception",
        "khepera_hil.reader",
        "khepera_hil.recording",
        "khepera_hil.wheels",
    },
    "khepera_hil.service": {
        "numpy",
        "khepera_hil.budget",
        "khepera_hil.clock",
        "khepera_hil.conduct",
        "khepera_hil.controllers",
        "khepera_hil.errors",
        "khepera_hil.guarding",
        "khepera_hil.khepera",
        "khepera_hil.lifecycle",
        "khepera_hil.orders",
        "khepera_hil.perception",
        "khepera_hil.quantiles",
        "khepera_hil.reader",
        "khepera_hil.recording",
        "khepera_hil.scheduler",
        "khepera_hil.transcript",
        "khepera_hil.wayback",
        "khepera_hil.wheels",
        "khepera_hil.witness",
    },
    "khepera_hil.wayback": {
        "khepera_hil.clock",
        "khepera_hil.errors",
        "khepera_hil.khepera",
        "khepera_hil.lifecycle",
        "khepera_hil.reconnection",
        "khepera_hil.recording",
        "khepera_hil.wheels",
    },
    "khepera_hil.checkup": {
        "khepera_hil.budget",
        "khepera_hil.errors",
        "khepera_hil.khepera",
        "khepera_hil.perception",
        "khepera_hil.protocol",
        "khepera_hil.quantiles",
        "khepera_hil.scheduler",
    },
    # the robot's end
    "khepera_hil.uart": {"khepera_hil.protocol"},
    "khepera_hil.motion": {"khepera_hil.units"},
    "khepera_hil.world": {
        "khepera_hil.world",
        "khepera_hil.errors",
        "khepera_hil.chance",
        "khepera_hil.motion",
        "khepera_hil.units",
        "numpy",
        "pymunk",
    },
    "khepera_hil.rom": {
        "khepera_hil.rom",
        "khepera_hil.errors",
        "khepera_hil.protocol",
        "khepera_hil.turrets",
        "khepera_hil.units",
        "khepera_hil.world",
    },
    "khepera_hil.emulator": {
        "khepera_hil.protocol",
        "khepera_hil.rom",
        "khepera_hil.uart",
        "khepera_hil.world",
    },
    "khepera_hil.disturbed": {
        "khepera_hil.chance",
        "khepera_hil.emulator",
        "khepera_hil.faults",
        "khepera_hil.faultspec",
        "khepera_hil.world",
    },
    "khepera_hil.ports": {
        "khepera_hil.ports",
        "khepera_hil.clock",
        "khepera_hil.disturbed",
        "khepera_hil.faults",
        "khepera_hil.faultspec",
        "khepera_hil.emulator",
        "khepera_hil.errors",
        "khepera_hil.rom",
        "khepera_hil.uart",
        "khepera_hil.world",
        "serial",
    },
    "khepera_hil.endpoints": {"khepera_hil.errors"},
    "khepera_hil.serve": {
        "khepera_hil.clock",
        "khepera_hil.disturbed",
        "khepera_hil.emulator",
        "khepera_hil.endpoints",
    },
    "khepera_hil.diary": {"khepera_hil.errors", "khepera_hil.faults", "khepera_hil.world"},
    "khepera_hil.onlooker": {"khepera_hil.recording", "khepera_hil.world"},
    # the rim
    "khepera_hil.recording": {"khepera_hil.errors", "numpy"},
    "khepera_hil.kinds": {"khepera_hil.recording"},
    "khepera_hil.reading": {"khepera_hil.kinds", "khepera_hil.recording", "khepera_hil.errors"},
    "khepera_hil.replay": {
        "brp",
        "numpy",
        "khepera_hil.errors",
        "khepera_hil.reading",
        "khepera_hil.recording",
    },
    "khepera_hil.otherwise": {
        "brp",
        "numpy",
        "khepera_hil.chance",
        "khepera_hil.controllers",
        "khepera_hil.errors",
        "khepera_hil.perception",
        "khepera_hil.protocol",
        "khepera_hil.reading",
        "khepera_hil.recording",
        "khepera_hil.replay",
        "khepera_hil.transcript",
    },
    "khepera_hil.explain": {"brp"},
    "khepera_hil.compare": {"khepera_hil.reading", "khepera_hil.recording"},
    "khepera_hil.export": {
        "khepera_hil.errors",
        "khepera_hil.protocol",
        "khepera_hil.reading",
        "khepera_hil.recording",
        "pyarrow",
    },
    "khepera_hil.follower": set(),
    "khepera_hil.apart": {"khepera_hil.follower"},
    "khepera_hil.viewer": {
        "khepera_hil.viewer",
        "khepera_hil.follower",
        "khepera_hil.reading",
        "khepera_hil.recording",
        "khepera_hil.errors",
        "numpy",
        "rerun",
        "rerun_bindings",
        "pyarrow",
    },
    "khepera_hil.terminal": {"khepera_hil.recording"},
    "khepera_hil.teaching": {
        "khepera_hil.teaching",
        "khepera_hil.controllers",
        "khepera_hil.errors",
        "khepera_hil.perception",
        "khepera_hil.reading",
        "khepera_hil.recording",
        "brp",
        "numpy",
        "scipy",  # late
        "evdev",  # late: an extra
    },
    "khepera_hil.experiments": {
        "khepera_hil",
        "brp",
        "numpy",
        "scipy",
        "serial",
        "rerun",
        "pyarrow",  # late
        "distributed",  # late: an extra
    },
    "khepera_hil.commands": {"khepera_hil", "brp", "numpy", "serial"},
    "khepera_hil.__main__": {"khepera_hil"},
}

# In brp each module may import those before it, and numpy; scipy is imported late, by who needs it.
BRP = [
    "errors",
    "variables",
    "propositions",
    "functions",
    "nearest",
    "factors",
    "samples",
    "distribution",
    "forms",
    "gaussian",
    "counts",
    "hierarchy",
    "evidence",
    "expression",
    "formula",
    "contraction",
    "order",
    "simplification",
    "renewal",
    "logs",
    "batch",
    "tables",
    "source",
    "products",
    "plan",
    "rows",
    "explain",
    "subroutine",
    "question",
    "description",
    "pointwise",
    "em",
    "store",
    "filter",
    "sampling",
    "mrbt",
    "derivative",
    "chain",
    "programs",
    "data",
]
TABLE |= {f"brp.{name}": {"numpy", *(f"brp.{before}" for before in BRP[:place])} for place, name in enumerate(BRP)}
TABLE["brp"] = {f"brp.{name}" for name in BRP if name not in {"programs", "data"}}  # the public face
TABLE["brp.variables"] |= {"brp.propositions"}  # late: Dir.is_(3) and Prox > 8 make propositions
TABLE["brp.question"] |= {"brp.description"}  # for the type checker alone: a description makes its questions
TABLE["brp.subroutine"] |= {"brp.question"}  # and so is this: a question makes itself a subroutine
TABLE["brp.formula"] |= {"brp.simplification"}  # and this
TABLE["brp.programs"] |= {"brp.programs"}

# What must not even come from the standard library.
FORBIDDEN = {"khepera_hil.protocol": {"time", "threading", "socket"}, "brp": {"time", "threading", "socket"}}

FILES = sorted(path for package in ("brp", "khepera_hil") for path in (ROOT / package).rglob("*.py"))


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def line_of(module: str) -> str | None:
    """The table's line that holds for a module: its own, or its package's, but never the root's for a child."""
    while module not in TABLE:
        module = module.rpartition(".")[0]
        if module in {"", "brp", "khepera_hil"}:
            return None
    return module


def imports_of(path: Path) -> set[str]:
    """All that a file imports, at its top or late inside a function; TYPE_CHECKING makes no difference."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module == "_typeshed":
            continue  # exists for type checkers only
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide who is imported"
            assert node.module is not None
            # from package import name: name may be a module of its own
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                known = (ROOT / Path(*full.split("."))).with_suffix(".py").exists()
                known |= (ROOT / Path(*full.split(".")) / "__init__.py").exists()
                if known or node.module != "khepera_hil":  # whose own names, such as its version, are anybody's
                    found.add(full if known else node.module)
    return found


def within(module: str, names: set[str]) -> bool:
    return any(module == name or module.startswith(name + ".") for name in names)


@pytest.mark.parametrize("path", FILES, ids=module_of)
def test_a_module_imports_only_what_the_house_allows(path: Path) -> None:
    module = module_of(path)
    line = line_of(module)
    assert line is not None, f"{module} is missing from the table: which room is it?"
    found = imports_of(path)
    stray = {
        name
        for name in found
        if name.split(".")[0] not in sys.stdlib_module_names and not within(name, TABLE[line])
    }
    assert not stray, f"{module} may not import {', '.join(sorted(stray))}"
    assert "khepera_hil.__main__" not in found, "nothing imports the command line's entry"
    for owner, names in FORBIDDEN.items():
        if within(module, {owner}):
            assert not (bad := {name for name in found if within(name, names)}), f"{module} may not import {bad}"


def test_every_line_of_the_table_has_a_file() -> None:
    modules = {module_of(path) for path in FILES}
    assert set(TABLE) <= modules


def test_the_service_cannot_tell_the_emulator_from_a_robot() -> None:
    """Not even by way of what it imports: nothing of the robot's end is loaded with it."""
    code = "import sys, khepera_hil.service; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = set(done.stdout.split())
    assert "khepera_hil.khepera" in loaded
    assert not loaded & {"khepera_hil.emulator", "khepera_hil.world", "pymunk", "rerun"}
