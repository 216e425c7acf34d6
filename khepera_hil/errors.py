"""Everything that can go wrong with a run, as one short tree.

    KheperaHilError                exit code 1
    |-- UsageError                 2  a mistake on the command line: the sentence says what to write instead
    |-- PortError                  3  the port cannot be opened, or belongs to somebody else
    |   `-- LinkLost               3  it was open and is gone
    |-- RobotError                 4  the port is there, but no Khepera that we understand is behind it
    |   |-- NoAnswer               4  nothing came before the deadline
    |   |-- BadAnswer              4  something came that is no answer to what was asked
    |   |-- Refused                4  the robot said that it did not understand the command
    |   |-- RobotReset             4  the robot was reset in mid-session: it forgot its speeds
    |   `-- Implausible            4  what was read twice does not agree, or cannot be after what was read before
    |-- GuardLost                  7  the guard, which would stop the wheels in our place, is not there
    |-- WireTooSlow                5  what a tick needs does not fit into the period at this baud rate
    |-- WorldError                 2  an arena that cannot be read or furnished
    |-- RecordingError             6  the run's folder cannot be written, or read back
    |-- ViewerError                1  the viewer is not there, or cannot draw here
    |-- CampaignError              1  a case that kills its worker, a scheduler or workers that cannot be had
    |-- OrderRefused               8  an order that no running program takes
    `-- ProtocolError              1  bytes that are not in the protocol's grammar (raised by ``protocol`` only)

``__main__`` turns each of them into one sentence on standard error and its ``exit_code``; nothing else
reaches the user as a traceback.
"""

from __future__ import annotations

__all__ = [
    "BadAnswer",
    "CampaignError",
    "GuardLost",
    "Implausible",
    "KheperaHilError",
    "LinkLost",
    "NoAnswer",
    "OrderRefused",
    "PortError",
    "ProtocolError",
    "RecordingError",
    "Refused",
    "RobotError",
    "RobotReset",
    "UsageError",
    "ViewerError",
    "WireTooSlow",
    "WorldError",
]


class KheperaHilError(Exception):
    """The root; its text is a sentence for the user that says what to do."""

    exit_code = 1


class UsageError(KheperaHilError):
    """A mistake on the command line that can be mended there."""

    exit_code = 2


class PortError(KheperaHilError):
    """The port cannot be opened, or belongs to somebody else."""

    exit_code = 3


class LinkLost(PortError):
    """The port was open and is gone: unplugged, or the emulator behind it died. Its object is of no more use."""


class RobotError(KheperaHilError):
    """The port is there, but no Khepera that we understand is behind it."""

    exit_code = 4


class NoAnswer(RobotError):
    """Nothing, or only part of an answer, came before the request's deadline."""


class BadAnswer(RobotError):
    """Something came that is no answer to what was asked."""


class Refused(RobotError):
    """The robot said that it did not understand: the command was mangled on its way, or is not in its ROM."""


class RobotReset(RobotError):
    """The robot printed its boot text in mid-session: its wheels stand still, and it forgot what it was told.

    Said at each request until there was a new handshake. Only the user knows whether it may drive on.
    """


class Implausible(RobotError):
    """Readings that no robot could give that was read just before, or that do not agree with themselves."""


class GuardLost(KheperaHilError):
    """The guard, which would stop the wheels in our place, is not there, or has acted."""

    exit_code = 7


class WireTooSlow(KheperaHilError):
    """What a tick needs does not fit into the period at this baud rate."""

    exit_code = 5


class WorldError(KheperaHilError):
    """An arena that cannot be read or furnished."""

    exit_code = 2


class RecordingError(KheperaHilError):
    """The run's folder cannot be written, or read back."""

    exit_code = 6


class ViewerError(KheperaHilError):
    """The viewer is not installed, or cannot draw here."""


class CampaignError(KheperaHilError):
    """Not all cases of a campaign can be measured: one kills its worker, or there are no workers to be had."""


class OrderRefused(KheperaHilError):
    """An order that no running program takes, or that nobody is there to take."""

    exit_code = 8


class ProtocolError(KheperaHilError):
    """Bytes or values that are not in the protocol's grammar."""
