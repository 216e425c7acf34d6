"""What pyserial is asked to open for ``--port`` and all that is said about the emulator."""

from __future__ import annotations

from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from khepera_hil.errors import UsageError
from khepera_hil.faultspec import Specification
from khepera_hil.world import load_scenario

__all__ = ["DEFAULT_WORLD", "port_url", "world_of"]

DEFAULT_WORLD = "furnished"


def port_url(
    port: str,
    world: str | None,
    scenario: str | None = None,
    *,
    fast: bool,
    seed: int,
    faults: str | None = None,
) -> str:
    """What pyserial is asked to open. Only the in-process emulator has worlds, scenarios and a simulated clock."""
    for flag, text in (("--port", port), ("--world", world), ("--scenario", scenario)):
        if text == "":
            raise UsageError(f"{flag} is empty; leave it out for the emulator in its usual arena")
    if port.partition(":")[0].lower() != "emulator":
        asked = {"--world": world, "--scenario": scenario, "--faults": faults, "--fast": fast or None}
        for flag, given in ((flag, value is not None) for flag, value in asked.items()):
            if given:
                raise UsageError(f"{flag} goes with --port emulator only; {port} is a robot of its own")
        return port
    try:
        parts = urlsplit(port if ":" in port else "emulator://")
    except ValueError:
        raise UsageError(f"--port {port} is no name of an emulator; write emulator://ARENA") from None
    named = unquote(parts.netloc + parts.path)
    if world is not None and named and named != world:
        raise UsageError(f"--port {port} and --world {world} name two different worlds; leave one of them out")
    # A plus is a plus, as in disconnect@30+5.
    query = dict(parse_qsl(parts.query.replace("+", "%2B"), keep_blank_values=True))
    for key, flag in (("seed", "--seed"), ("clock", "--fast")):
        if key in query:
            raise UsageError(f"{key} does not go into the port's name; say {flag}")
    if scenario is not None and query.setdefault("scenario", scenario) != scenario:
        raise UsageError(
            f"--port {port} and --scenario {scenario} name two different scenarios; leave one of them out"
        )
    if not (where := world or named) and "scenario" in query:
        where = load_scenario(query["scenario"]).world or ""
    query |= {"seed": str(seed), "clock": "simulated" if fast else "wall"}
    if faults is not None and query.setdefault("faults", faults) != faults:
        raise UsageError(f"--port {port} and --faults {faults} name two different faults; leave one of them out")
    if "faults" in query:
        Specification.parse(query["faults"])  # a mistake is told before anything else happens
    return f"emulator://{quote(where or DEFAULT_WORLD)}?{urlencode(query, quote_via=quote)}"


def world_of(url: str) -> dict[str, str | None]:
    """Name and scenario of the world that a URL is about."""
    parts = urlsplit(url)
    query = dict(parse_qsl(parts.query))
    return {"name": unquote(parts.netloc + parts.path), "scenario": query.get("scenario")}
