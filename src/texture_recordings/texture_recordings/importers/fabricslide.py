"""The slides of a 16-taxel capacitive finger over fabrics and printed gratings, as labelled bags.

Source: github wngfra/FabricSlide (Wang et al. 2022, "Fabric Classification Using a Finger-Shaped Tactile Sensor via
Robotic Sliding", MIT licence), joined into one `runs.npz`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_recordings.importers.slide_file import SlideFile
from texture_recordings.importers.steady_slides import ImportedStream, SteadySlide

FABRIC = re.compile(r'([^/]+)/F(\d+)/V(-?\d+)/(\d+)')
GRATING = re.compile(r'grating/([^/]+?)_F(\d+)_V(-?\d+)mmps_(\d+)')
TAXELS = slice(3, 19)  # after the time (ms) and two proximities
ROW_S = 0.028
STREAM = ImportedStream(
    'signal_static', 'cpm/taxels', tuple(f'taxel{number}' for number in range(1, 17)), 'count', 1.0 / ROW_S
)
# The finger speeds up along a quarter sine in the time that it then takes for 47 mm, slides 500 mm, and slows down
# likewise (`setDuration`, `setTimeMax` of the published controller).
RAMP_M, STEADY_M = 0.03 * math.pi / 2, 0.5
COUNTS_PER_FORCE = 100.0


class SlideRun(NamedTuple):
    """How one run was made; sorted as the slides are numbered: down before up, then by force, speed and repeat.

    Examples
    --------
    >>> sorted([SlideRun(True, 500, 10, 1), SlideRun(False, 800, 10, 1)])[0].up  # down comes first
    False
    """

    up: bool
    counts: int
    speed_mm_s: int
    repeat: int


def place(key: str) -> tuple[str, SlideRun] | None:
    """Return fabric or grating of a key, and the run."""
    match = GRATING.fullmatch(key) or FABRIC.fullmatch(key)
    if not match:
        return None
    speed = int(match[3])
    return match[1], SlideRun(speed > 0, int(match[2]), abs(speed), int(match[4]))


def slide(key: str, surface: str, run: SlideRun, recorded: AnyArray) -> SteadySlide:
    """Return a slide, given its rows as recorded.

    Parameters
    ----------
    key
        Name of the run in the file.
    surface
        Label of the fabric or grating.
    run
        Direction, force, speed and repeat.
    recorded : (n_rows, n_columns)
        Time in s and the taxels.

    Returns
    -------
    SteadySlide
    """
    speed_m_s = run.speed_mm_s / 1000.0
    direction_rad = math.pi / 2 if run.up else -math.pi / 2
    first, last = (round(way / speed_m_s / ROW_S) for way in (RAMP_M, RAMP_M + STEADY_M))
    # A run that is not of that length, as those over gratings, is taken as it is.
    steady = range(first, last) if first < last <= len(recorded) else None
    return SteadySlide(
        key, surface, recorded[:, TAXELS], speed_m_s, run.counts / COUNTS_PER_FORCE, direction_rad, steady
    )


DATA = SlideFile('runs.npz', STREAM, place, slide)


def import_fabricslide(
    source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = (), channels: str = 'all'
) -> list[Path]:
    """Write one bag a fabric or grating ('Canvas', 'Board10mm') from runs.npz, and return their paths.

    The runs of a fabric are numbered by direction (down first), then force, speed and repeat: of a complete fabric 1-60
    go down and 61-120 up, and within them each force has twelve in a row. Rows are 28 ms apart and are written as they
    are, on `signal_static`; there is no vibration, so `channels` must be 'all'. Force: the grip was regulated to a mean
    reading of the taxels, not to newtons; `force_n` holds that reading in hundreds of counts, which distinguishes and
    orders forces, and is no force in newtons. Direction: +π/2 up, −π/2 down. The states say `contact` while the finger
    speeds up and `lift` while it slows down.
    """
    if channels != 'all':
        raise InvalidData(f"channels are '{channels}'; this finger has slow taxels alone, import 'all'")
    return DATA.write_bags(source, out, slides, materials)
