"""What a process uses, as the kernel tells it (Linux)."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

TICKS_PER_S = os.sysconf('SC_CLK_TCK')
KIB = 1024


@dataclass(frozen=True)
class ProcessUsage:
    """What a process used at a time.

    Parameters
    ----------
    time_s
        When (monotonic clock).
    node, pid
        Whose.
    resident_bytes
        Memory in RAM, with what it shares with others (VmRSS).
    own_bytes
        The part that is its own and no file (RssAnon): what grows if something is forgotten.
    cpu_s
        Computing time since it began.
    threads, files
        How many it has, and has open.
    """

    time_s: float
    node: str
    pid: int
    resident_bytes: int
    own_bytes: int
    cpu_s: float
    threads: int
    files: int


def read_usage(node: str, pid: int, time_s: float) -> ProcessUsage | None:
    """Return what a process uses now; None if it has ended.

    Parameters
    ----------
    node
        Name that the usage bears.
    pid
        Number of the process.
    time_s
        Time that the usage bears.

    Returns
    -------
    ProcessUsage or None
    """
    folder = Path('/proc') / str(pid)
    try:
        status = (folder / 'status').read_text(encoding='ascii', errors='replace')
        # The name of the command, in parentheses, may hold blanks: the fields are counted from behind it.
        fields = (folder / 'stat').read_text(encoding='ascii', errors='replace').rpartition(')')[2].split()
        files = len(list((folder / 'fd').iterdir()))
    except OSError:
        return None
    numbers = {name: int(value) for name, value in re.findall(r'^(\w+):\s+(\d+)', status, re.MULTILINE)}
    if 'VmRSS' not in numbers:  # it has ended, and nobody has asked how yet
        return None
    return ProcessUsage(
        time_s=time_s,
        node=node,
        pid=pid,
        resident_bytes=KIB * numbers['VmRSS'],
        own_bytes=KIB * numbers['RssAnon'],
        cpu_s=(int(fields[11]) + int(fields[12])) / TICKS_PER_S,
        threads=numbers['Threads'],
        files=files,
    )
