"""The command line's commands, a module each. The main job, ``run``, needs no word."""

from types import MappingProxyType

from khepera_hil.commands import emulate, identify, run, teach
from khepera_hil.commands.parser import Command

__all__ = ["COMMANDS"]

COMMANDS: MappingProxyType[str, Command] = MappingProxyType(
    {"run": run, "emulate": emulate, "teach": teach, "identify": identify}
)
