"""``springmass ports``: the serial ports of this machine, what speaks on them, and the sensors that can be recorded."""

import json
import shlex
from typing import Annotated, Any

from acquisition.decoders.registry import families
from acquisition.errors import visible
from acquisition.live.serial_port import list_ports
from springmass.commands.options import Json
from springmass.commands.parameters import flag, option
from springmass.errors import HINT, LOG, OK
from springmass.session.detect import listen
from springmass.terminal.printing import wrapped


def ports(
    *,
    no_probe: Annotated[bool, flag("only list the ports; do not open them")] = False,
    port: Annotated[tuple[str, ...], option("P", "also listen on this address; may be repeated")] = (),
    as_json: Json = False,
) -> int:
    """List ports, listening to each for a second at each of the usual speeds, and the families of sensors."""
    rows = [_row(each.device, each.description or "", not no_probe) for each in list_ports()]
    rows += [_row(address, "named on the command line", True) for address in port]
    if as_json:
        print(json.dumps({"ports": rows, "sensors": [family.describe() for family in families()]}))
        return OK
    if not rows:
        print("no serial port on this machine; `springmass record --simulate` runs without one")
    for row in rows:
        print(visible(f"{row['device']:<16} {row['description']}"))
        if row["heard"] is not None:
            print(visible(f"{'':<16} {row['heard']}"))
    print(f"\n{'sensor':<18} {'rate / Hz':>9} {'step / mm':>9} {'range / m':>13} {'baud':>7}")
    for family in families():
        reach, step = "{:g} to {:g}".format(*family.range_m), f"{family.resolution_m * 1e3:.3g}"
        print(f"{family.name:<18} {family.rate_hz:>9.3g} {step:>9} {reach:>13} {family.baud:>7}")
        print(wrapped(f"    {family.title}. {family.limits}", "    "))
    recognised = [row["device"] for row in rows if row["families"]]
    LOG.log(
        HINT, f"springmass record --port {shlex.quote(recognised[0])}" if recognised else "springmass record --simulate"
    )
    return OK


def _row(device: str, description: str, probed: bool) -> dict[str, Any]:
    heard, families, _ = listen(device) if probed else (None, [], 0)
    return {"device": device, "description": description, "heard": heard, "families": families}
