"""The slides of a 9-taxel MEMS array over 21 textures at several speeds and forces, as labelled bags.

Source: github LIMB-UCF/NTP ("Neuromorphic Real-time Tactile Perception Invariant to Contact Dynamics"), joined into one
`slides.npz` with a key `textureNNN/speedSSS/forceF.F` (mm/s, N over contact) for each slide.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData
from texture_recordings.importers.slide_file import SlideFile
from texture_recordings.importers.steady_slides import ImportedStream, SteadySlide

KEY = re.compile(r'([^/]+)/speed(\d+(?:\.\d+)?)/force(\d+(?:\.\d+)?)')
TAXELS = 9
TIME = 10  # column of the time, s; the one between is auxiliary and of unknown meaning: left out
RATE_HZ = 320.0
SLOWEST = 10.0  # times the nominal duration; a time stamp that is wrong would ask for any number of samples
# The published signal has no unit.
STREAM = ImportedStream('signal', 'ntp/array', tuple(f'taxel{n}' for n in range(1, TAXELS + 1)), '', RATE_HZ)


class SlideCondition(NamedTuple):
    """How one slide was made; sorted as the slides are numbered: by speed, then by force.

    Examples
    --------
    >>> sorted([SlideCondition(20.0, 0.5), SlideCondition(10.0, 1.0)])[0].speed_mm_s  # the slowest comes first
    10.0
    """

    speed_mm_s: float
    force_n: float


def place(key: str) -> tuple[str, SlideCondition] | None:
    """Return texture and condition of a key."""
    match = KEY.fullmatch(key)
    return (match[1], SlideCondition(float(match[2]), float(match[3]))) if match else None


def slide(key: str, texture: str, condition: SlideCondition, recorded: AnyArray) -> SteadySlide:
    """Return a slide, given its rows as recorded.

    Parameters
    ----------
    key
        Name of the slide in the file.
    texture
        Label of the texture.
    condition
        Speed, force and direction.
    recorded : (n_rows, n_columns)
        Time in s and the taxels.

    Returns
    -------
    SteadySlide
    """
    samples = evenly(np.asarray(recorded[:, :TAXELS], dtype=float), float(recorded[-1, TIME] - recorded[0, TIME]))
    return SteadySlide(key, texture, samples, condition.speed_mm_s / 1000.0, condition.force_n, math.nan)


def evenly(samples: Array, duration_s: float) -> Array:
    """Return samples, evenly spaced over a duration, at 320 Hz, (n, n_channels).

    Parameters
    ----------
    samples : (n_recorded, n_channels)
        Evenly spaced over the duration.
    duration_s
        Time from the first to the last sample.

    Returns
    -------
    (n, n_channels)
        In the unit of the samples.

    Raises
    ------
    ValueError
        If there are too few samples, or the duration makes no sense.
    """
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 – nothing else in this package needs scipy

    if not 0 < duration_s <= SLOWEST * len(samples) / RATE_HZ:
        raise ValueError(f'{len(samples)} samples lasted {duration_s:g} s, at {RATE_HZ:g} Hz')
    own = np.linspace(0.0, duration_s, len(samples))
    grid = np.arange(int(duration_s * RATE_HZ) + 1) / RATE_HZ
    values: Array = CubicSpline(own, samples, axis=0)(grid)
    return values


DATA = SlideFile('slides.npz', STREAM, place, slide)


def import_ntp21(
    source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = (), channels: str = 'all'
) -> list[Path]:
    """Write one bag a texture, 'texture00' and so on, from slides.npz, and return their paths.

    The slides of a texture are numbered by speed, and by force within a speed: with four speeds and four forces, 1-4
    are the slowest, of rising force, and 13-16 the fastest. The recorded stamps jitter by half a sample while the
    samples are evenly spaced (read so, the speeds agree better with each other): each slide is read as evenly spaced
    from its first stamp to its last, and brought from its own rate (310 to 323 Hz) to 320 Hz by a cubic spline.
    `force_n` is the force beyond first contact. Fast channels and all are the same: the nine taxels.
    """
    if channels not in ('fast', 'all'):
        raise InvalidData(f"channels are '{channels}'; 'fast' or 'all' is needed")
    return DATA.write_bags(source, out, slides, materials)
