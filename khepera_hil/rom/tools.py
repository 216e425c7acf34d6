"""The texts of the robot's tools: what a person types at a terminal (manual, section 6.1).

The manuals give each tool's name and what it tells; the words are ours, in the shape that is documented. An answer
of several lines has no mark at its end.
"""

from __future__ import annotations

from collections.abc import Iterable

from khepera_hil.protocol import COMMANDS
from khepera_hil.rom.models import Model
from khepera_hil.turrets import TURRETS

__all__ = ["FUNCTIONS", "TOOLS", "about_maker", "help_text", "lines", "listing", "memory", "network", "processes"]

TOOLS = {
    "run": ("run <function>", "starts a function of the ROM: run demo, run sloader"),
    "serial": ("serial <baud>", "changes the rate of the serial line at once, until the next restart"),
    "help": ("help [<item>]", "tells about a tool or a command: help serial, help D"),
    "list": ("list", "tells all modules: tasks (TA), functions (FU), protocol (PR), tools (TO) and BIOS (BI)"),
    "k-team": ("k-team", "tells who made the robot"),
    "net": ("net", "tells the intelligent turrets that are fitted"),
    "memory": ("memory", "tells how much of the memories is used"),
    "process": ("process", "tells the processes"),
    "restart": ("restart", "starts the robot anew, as its reset button does"),
    "sfill": ("sfill", "takes a program in Motorola's S format and does not start it"),
    "flash": ("flash E, flash W", "erases or writes the FLASH memory's user segments"),
}
"""Name to usage and description; ``flash`` on a Khepera II only."""

FUNCTIONS = {
    "demo": "vehicle that turns away from what is near",
    "sloader": "loader of programs in Motorola's S format",
    "user-flash": "program in the user's FLASH memory",
}
"""What ``run`` starts; ``user-flash`` on a Khepera II only."""

_REVISION = "Rev. 5.00"


def lines(*texts: str) -> bytes:
    """Texts as the robot prints them, a line each."""
    return "".join(text + "\r\n" for text in texts).encode("ascii")


def tools_of(model: Model) -> list[str]:
    """The tools that this robot has."""
    return [name for name in TOOLS if name != "flash" or model.flash]


def functions_of(model: Model) -> list[str]:
    """What ``run`` can start on this robot."""
    return [name for name in FUNCTIONS if name != "user-flash" or model.flash]


def help_text(model: Model, item: str | None) -> bytes | None:
    """About one item, or the list of tools; None for an item that there is not."""
    if item is None:
        usages = (TOOLS[name] for name in tools_of(model))
        return lines(*(f"{usage:<18}{does}" for usage, does in usages))
    if item in tools_of(model):
        usage, does = TOOLS[item]
        return lines(f"Tool {item}: {does}", f"Format: {usage}")
    command = COMMANDS.get(item)
    if command is None:
        return None
    request = ", ".join([item, *(field.name for field in command.request)])
    answer = ", ".join([item.lower(), *(field.name for field in command.answer)])
    if command.form == "turret":
        request, answer = request + ", command", answer + ", answer"
    elif command.form == "versions":
        answer += ", version of the BIOS, version of the protocol"
    told = [
        f"Command {item}: {command.title}",
        f"Format of the command: {request}",
        f"Format of the answer: {answer}",
    ]
    ranges = [
        f"{field.name}: {field.low}..{field.high}" + f" {field.unit}".rstrip()
        for field in command.request + command.answer
    ]
    return lines(*told, *dict.fromkeys(ranges))


def listing(model: Model) -> bytes:
    """All modules: identifier, name, description, version."""
    bios, protocol = model.versions
    rows = [("TA00", "idle", "idle task", _REVISION), ("TA01", "start", "start-up task", _REVISION)]
    rows += [(f"FU{i:02}", name, FUNCTIONS[name], _REVISION) for i, name in enumerate(functions_of(model))]
    rows += [
        (f"PR{i:02}", letter, command.title, f"Rev. {protocol}")
        for i, (letter, command) in enumerate(COMMANDS.items())
    ]
    rows += [(f"TO{i:02}", name, TOOLS[name][1], _REVISION) for i, name in enumerate(tools_of(model))]
    rows += [("BI00", "bios", "basic input and output", f"Rev. {bios}")]
    return lines(*(f"{which} {name:<11}{does}: {revision}" for which, name, does, revision in rows))


def about_maker() -> bytes:
    """Who made the robot, and what this one is."""
    return lines("The Khepera is a robot of K-Team S.A., Switzerland.", "This one is emulated by khepera-hil.")


def network(fitted: Iterable[tuple[int, tuple[int, int]]]) -> bytes:
    """The intelligent turrets: name, identifier, description, revision; numbers and versions come in."""
    rows = [
        f"{TURRETS[number].name:<10}ID {number:02}  {TURRETS[number].title}: Rev. {version}.{revision:02}"
        for number, (version, revision) in fitted
    ]
    return lines(*rows) if rows else lines("No intelligent turret is fitted")


def memory() -> bytes:
    """As a robot without a user's program says it."""
    return lines(
        "First free ROM address:   16'00012490, used 57%",
        "First free RAM 1 address: 16'001243F4, used 13%",
        "First free RAM 2 address: 16'001A0000, used 0%",
    )


def processes(demo: bool) -> bytes:
    """What runs."""
    running = ["Idle process of the kernel", "Start-up process of the robot"]
    running += ["Process of the demonstration"] if demo else []
    return lines(*(f"Process N. {number:08}  {what}: {_REVISION}" for number, what in enumerate(running)))
