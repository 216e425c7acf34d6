"""``python -m benchmarks``: every benchmark that takes about a minute or less, one after the other.

``python -m benchmarks.behaviour`` (how well the programs do over many seeds) takes minutes and is called alone.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys

for name, *options in (("emulator",), ("recording",), ("engine", "--seconds", "0.3")):
    print(
        f"== {name} ({platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()})", flush=True
    )
    subprocess.run([sys.executable, "-m", f"benchmarks.{name}", *options], check=True)
