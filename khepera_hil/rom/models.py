"""The two robots: what tells them apart on the line."""

from __future__ import annotations

from dataclasses import dataclass

from khepera_hil.errors import UsageError
from khepera_hil.protocol import BAUD_RATES

__all__ = ["KHEPERA", "KHEPERA_2", "MODELS", "Model", "model_for"]


@dataclass(frozen=True)
class Model:
    """One robot: ``rates`` are those of its modes, ``versions`` what B answers (BIOS and protocol)."""

    name: str
    title: str
    rates: tuple[int, ...]
    versions: tuple[str, str]
    boot: bytes
    flash: bool
    """Whether it has a flash memory for the user, and the tool of that name."""
    charger: bool
    """Whether its A/D inputs 0 to 2 and 6 are wired: charger, reflected and ambient light, current."""


KHEPERA = Model(
    "khepera",
    "a Khepera",
    BAUD_RATES[:3],
    ("5.01", "5.00"),
    b"ROM of minirobot KHEPERA, Edoardo Franzi K-Team S.A. October 22, 1998 Rev. 5.01\r\n"
    b"Serial Communication Protocol\r\n",
    flash=False,
    charger=False,
)
"""Boot text from K-Team's Khepera FAQ, versions as a real robot answered."""

# What K-Team's manual shows (Khepera II manual 1.1, p. 23), the lettering drawn anew and the address left out.
_BOOT_2 = r"""

 (c) 1992-2001, Edoardo Franzi
 -----------------------------------------------------------------
         _  __   ___    ___
  _  _  | |/ /  / _ \  / __|    uKernel Operating System
 | || | | ' <  | (_) | \__ \
  \_,_| |_|\_\  \___/  |___/    implementation for K-Team S.A.

 CALM 68xxx implementation.
 Design & Development by Edoardo Franzi.
 All rights reserved.


ROM of minirobot KII, Edoardo Franzi, September 1, 2001 Rev. 6.01 beta
Serial Communication Protocol
"""

KHEPERA_2 = Model(
    "khepera2",
    "a Khepera II",
    BAUD_RATES,
    ("6.01", "6.01"),
    _BOOT_2.replace("\n", "\r\n").encode("ascii"),
    flash=True,
    charger=True,
)
"""What its B answers is printed nowhere; its boot text says 6.01."""

MODELS = {model.name: model for model in (KHEPERA, KHEPERA_2)}


def model_for(name: str | None, baud: int) -> Model:
    """The robot of this name, if one of its modes has the rate; by default a Khepera, where it has the rate.

    Raises UsageError.
    """
    if name is not None and name not in MODELS:
        raise UsageError(f"there is no robot {name!r}; there are {' and '.join(MODELS)}")
    if name is None:
        name = KHEPERA.name if baud not in KHEPERA_2.rates or baud in KHEPERA.rates else KHEPERA_2.name
    model = MODELS[name]
    if baud not in model.rates:
        rates = ", ".join(map(str, model.rates))
        other = f" ({KHEPERA_2.title} does)" if model is KHEPERA and baud in KHEPERA_2.rates else ""
        who = (
            f"no Khepera talks at {baud} baud"
            if baud not in BAUD_RATES
            else f"{model.title} does not talk at {baud} baud{other}"
        )
        raise UsageError(f"{who}; choose one of {rates}")
    return model
