"""What the README says: its program runs, its options are those of the command line, its files are there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def test_the_program_runs_and_prints_what_it_says_beside_it() -> None:
    (program,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    (said,) = re.findall(r"^print\(.*?# (.*)$", program, re.MULTILINE)
    assert done.stdout.strip() == said


def test_every_option_of_the_main_job_is_described_and_no_other() -> None:
    help_page = subprocess.run(
        [sys.executable, "-m", "khepera_hil", "--help"], capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout
    options = set(re.findall(r"^  (--[a-z]+)", help_page, re.MULTILINE))
    section = README[README.index("## The command line") :].split("\n## ")[0]
    table = set(re.findall(r"^\| `(--[a-z]+)", section, re.MULTILINE))
    assert options
    assert table == options


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\((?!http)([^)#]+)\)", README))))
def test_what_it_links_to_is_there(target: str) -> None:
    assert (ROOT / target).exists()


def test_every_room_of_the_house_is_in_its_plan() -> None:
    plan = README[README.index("## The house") :]
    for package in ("brp", "khepera_hil"):
        for room in (ROOT / package).iterdir():
            name = room.stem
            if not name.startswith("__") and (room.suffix == ".py" or (room / "__init__.py").exists()):
                assert re.search(rf"\b{name}\b", plan), f"{package}/{room.name} is missing from the README's plan"
