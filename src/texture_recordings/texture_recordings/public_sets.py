# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Importers of the public recordings."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.cli import progress
from texture_core.config import Arrays, open_regular, unknown_name
from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, AnyArray, Array, ExplorationState, Phase, TactileSignal
from texture_recordings.bags import SlideBags, SlideStreams, slide_batches
from texture_recordings.slides import parse_selection

Recording = tuple[Sequence[ExplorationState], SlideStreams]  # of a slide, as `SlideBags.write` takes them


@dataclass(frozen=True)
class PublicSet:
    """A data set: what its files and slides are called, and how a slide is read.

    Call it with the folder of the files, the folder for the bags, the numbers of the slides of each surface ('' for
    all), and surfaces (none for all); it returns the bags.
    """

    files: str  # a name or a pattern, such as '2021-*.npz'
    key: str  # pattern of the name of a file and of an array in it that is a slide, or the first one of a slide
    order: Callable[..., tuple[str, tuple[Any, ...]]]  # groups of the key → surface, and what its slides are sorted by
    slide: Callable[[str, tuple[Any, ...], Arrays, str], Recording]  # of a surface, that order, and the array in a file
    dated: bool = False  # a bag for each first member of the order, not for each surface
    number: Callable[[tuple[Any, ...]], int] | None = None  # of a slide by its order; None if by its rank
    others: str = ''  # pattern of the names of the other arrays

    def __call__(
        self, source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = ()
    ) -> list[Path]:
        """Write the bags, and return their paths."""
        files = sorted(Path(source).glob(self.files))
        if not files:
            raise InvalidData(f"no file {self.files} in '{source}'; give the folder that holds it")
        found: defaultdict[str, list[tuple[tuple[Any, ...], Path, str]]] = defaultdict(list)
        with ExitStack() as opened:
            contents: dict[Path, Arrays] = {}
            for file in files:
                with _reading(file, OSError):
                    contents[file] = Arrays(opened.enter_context(open_regular(file)))
                for key in contents[file].names:
                    if match := re.fullmatch(self.key, f'{file.stem}/{key}'):
                        surface, order = self.order(*match.groups())
                        found[surface].append((order, file, key))
                    elif not re.fullmatch(self.others, key):
                        raise InvalidData(f"'{file}' holds '{key}', which is not of this data set; fetch it again")
            if not found:
                raise InvalidData(f"the files {self.files} in '{source}' hold no slide; fetch them again")
            chosen = _chosen(found, slides, materials, self.number)
            if self.dated:
                chosen.sort(key=lambda slide: str(slide[1][0]))
            bags = opened.enter_context(SlideBags(out))
            for surface, order, file, key in progress(chosen, 'importing slides', len(chosen)):
                with _reading(file, OSError):
                    recording = self.slide(surface, order, contents[file], key)
                with _reading(file):
                    bags.write(order[0] if self.dated else surface, *recording)
        return bags.paths


def _chosen(
    found: Mapping[str, Sequence[Any]], slides: str, surfaces: Sequence[str], number_of: Callable[[Any], int] | None
) -> list[Any]:
    """Return the wanted slides, each behind its surface, numbered separately for each surface."""
    for name in surfaces:
        if name not in found:
            raise unknown_name(name, found, 'surface')
    wanted, chosen = parse_selection(slides), []
    for surface in surfaces or sorted(found):
        ordered = sorted(found[surface])
        numbered = [(number_of(slide[0]) if number_of else rank, slide) for rank, slide in enumerate(ordered, 1)]
        of_surface = [(surface, *slide) for number, slide in numbered if wanted is None or number in wanted]
        if not of_surface:
            first, last = numbered[0][0], numbered[-1][0]
            raise InvalidData(f"'{surface}' has none of the requested slides; it has {first} to {last}")
        chosen += of_surface
    return chosen


@contextmanager
def _reading(file: Path, *more: type[Exception]) -> Iterator[None]:
    """Refuse a file whose content is not as that of its data set."""
    refused: tuple[type[Exception], ...] = (ValueError, LookupError, ArithmeticError, TypeError, MemoryError, *more)
    try:
        yield
    except refused as error:
        raise InvalidData(f"'{file}' is not a file of this data set: {error}; fetch it again") from error


def _checked(name: str, values: AnyArray, *, nan: bool = False) -> AnyArray:
    """Return values, (n, n_columns), if they are two finite rows or more, or any with `nan`; ValueError otherwise."""
    if values.dtype.kind not in 'iuf' or not (nan or (len(values) > 1 and np.isfinite(values).all())):
        raise ValueError(f"'{name}' has shape {values.shape}, type {values.dtype}; rows of finite numbers are needed")
    return values.reshape(len(values), -1)


def _signal(sensor: str, channels: tuple[str, ...], unit: str, rate_hz: float, samples: AnyArray) -> TactileSignal:
    return TactileSignal(0, sensor, channels, (unit,) * len(channels), rate_hz, 0, samples, sensor)


# --------------------
# The BioTac recordings of 20 materials × 40 slides, a bag each ('material01'): PAC at 2200 Hz, slow channels at 100 Hz.
#
# Source: github dexrob/BioTac_slide_20_50 (Gao et al. 2020, "Supervised Autoencoder Joint Learning on Heterogeneous
# Tactile Sensory Data"), cut into one `materialNN.npz` a material.

FRAME_NS = 10_000_000  # a frame every 10 ms; its recorded times jitter by the host's scheduling
# Every slide is cut to the length of the shortest material, or its length would reveal the label. The finger runs at
# speed from the first frame on.
SLIDE_FRAMES = 600
NORMAL_FORCE = 2  # column of `wrench`: y of the tool, the one component that presses whatever the direction of travel
PAC_PER_FRAME = 22
PAC_COLUMNS = slice(3, 3 + PAC_PER_FRAME)
STATIC_CHANNELS = ('tdc', 'tac', 'pdc', *(f'electrode{i}' for i in range(1, 20)))
STATIC_COLUMNS = (0, 1, 2, *range(25, 44))
BIOTAC_BATCH_S = 0.02
STATE_BATCHES = 5  # a state every 0.1 s
LONGEST_S = 1000.0  # of one slide; frames that are missing are counted, however many
LOST_AFTER_S = 0.025  # frame times jitter by up to 8 ms; a larger step is a loss


def _biotac20_slide(surface: str, order: tuple[Any, ...], arrays: Arrays, _key: str) -> Recording:
    """Return a slide with a state every 0.1 s, whose speed (m/s) and force (N) were measured next to it."""
    slide = order[0]
    frames, frame_time = (
        _checked(name, arrays[name])[:SLIDE_FRAMES] for name in (f'{slide}/frames', f'{slide}/frame_time')
    )
    if frame_time.shape != (len(frames), 1) or np.ptp(frame_time) > LONGEST_S:
        raise ValueError(f"'{slide}' does not have a time for each of its frames, within {LONGEST_S:g} s")
    places, frame_hz = frame_indices(frame_time[:, 0]), NANOSECONDS / FRAME_NS
    vibration, fast_places = restore_sign(frames[:, PAC_COLUMNS].ravel())[:, None], np.arange(PAC_PER_FRAME)
    fast = _signal('biotac/pac', ('pac',), 'count', PAC_PER_FRAME * frame_hz, vibration)
    slow = _signal('biotac/slow', STATIC_CHANNELS, 'count', frame_hz, frames[:, STATIC_COLUMNS])
    measured = (_checked(name, arrays[f'{slide}/{name}'], nan=True) for name in ('velocity', 'wrench'))
    velocity, wrench = (rows[np.isfinite(rows).all(axis=1)] for rows in measured)  # behind the time, s
    x, y = velocity[:, 1:3].mean(axis=0) if len(velocity) else (math.nan, math.nan)
    named = ExplorationState(
        0, f'{surface}/{slide}', 'linear_slide', Phase.SLIDE, direction_rad=math.atan2(y, x), surface=surface
    )
    states = []
    for batch in list(slide_batches(slow, places, 0, batch_s=BIOTAC_BATCH_S))[::STATE_BATCHES]:
        since_s = batch.stamp_ns / NANOSECONDS
        speed_m_s = _at(since_s, velocity[:, 0], np.hypot(velocity[:, 1], velocity[:, 2]))
        force_n = _at(since_s, wrench[:, 0], wrench[:, NORMAL_FORCE])
        states.append(replace(named, stamp_ns=batch.stamp_ns, speed_m_s=speed_m_s, force_n=force_n))
    streams = {
        'signal': (fast, np.add.outer(PAC_PER_FRAME * places, fast_places).ravel()),
        'signal_static': (slow, places),
    }
    return states, streams


def frame_indices(frame_time: AnyArray) -> AnyArray:
    """Return the running index of each frame on the 10 ms grid: it jumps where frames are missing."""
    steps = np.diff(np.asarray(frame_time, dtype=float))
    missing = np.where(steps > LOST_AFTER_S, np.rint(steps / (FRAME_NS / NANOSECONDS)) - 1, 0)
    return np.concatenate([[0], np.cumsum(1 + missing)]).astype(int)


def restore_sign(rectified: AnyArray) -> Array:
    """Return a vibration from its rectified samples, up to one sign for the whole.

    The sign of each sample is the one that continues the straight line through the two before it.
    """
    x = np.asarray(rectified, dtype=float)
    # Where the line through two samples of equal sign crosses zero, the sign turns; right after a crossing the line
    # leads away from zero, so of neighbouring turns only every second one is taken.
    turn = np.zeros(x.shape, dtype=bool)
    turn[2:] = 2 * x[1:-1] < x[:-2]
    index = np.arange(len(x))
    last_still = np.maximum.accumulate(np.where(turn, -1, index))
    flip = turn & ((index - last_still) % 2 == 1)
    signs: Array = np.where(np.cumsum(flip) % 2, -1.0, 1.0)
    return x * signs


def _at(time_s: float, times: AnyArray, values: AnyArray) -> float:
    """Return what was measured at a time; NaN if nothing was."""
    return float(np.interp(time_s, times, values)) if len(times) else math.nan


# --------------------
# Sets of one stream of evenly spaced samples at a constant speed and force.


# Samples (n, n_channels), speed (m/s), force (N) and direction (rad), NaN if unknown, and the samples in which the
# finger slides: before them it is in contact, after them it lifts; None for all.
SteadySlide = tuple[AnyArray, float, float, float, range | None]
UNKNOWN = (math.nan, math.nan, math.nan)


def _steady(
    topic: str,
    signal: Callable[[AnyArray], TactileSignal],
    read: Callable[[tuple[Any, ...], AnyArray], SteadySlide],
    motion: str = 'linear_slide',
) -> Callable[[str, tuple[Any, ...], Arrays, str], Recording]:
    """Return the function for `PublicSet.slide` that reads a slide of such a set."""

    def slide(surface: str, order: tuple[Any, ...], arrays: Arrays, key: str) -> Recording:
        samples, speed_m_s, force_n, direction_rad, steady = read(order, _checked(key, arrays[key]))
        whole = signal(samples)
        steady = steady or range(len(samples))
        named = ExplorationState(
            0, key, motion, Phase.SLIDE, speed_m_s=speed_m_s, force_n=force_n, direction_rad=direction_rad,
            surface=surface,
        )  # fmt: skip
        begins = {Phase.CONTACT: 0, Phase.SLIDE: steady.start, Phase.LIFT: steady.stop}
        states = [
            replace(named, phase=phase, stamp_ns=round(row * NANOSECONDS / whole.sampling_rate_hz))
            for phase, row in list(begins.items())[not steady.start :]
        ]
        return states, {topic: (whole, np.arange(len(samples)))}

    return slide


def _taxels(count: int) -> tuple[str, ...]:
    return tuple(f'taxel{number}' for number in range(1, count + 1))


# --------------------
# fabricslide: a 16-taxel capacitive finger over fabrics and printed gratings, one bag each ('Canvas', 'Board10mm').
#
# Source: github wngfra/FabricSlide (Wang et al. 2022, "Fabric Classification Using a Finger-Shaped Tactile Sensor via
# Robotic Sliding", MIT licence), joined into one `runs.npz`. Runs are numbered by direction (down first), then force,
# speed and repeat: of a complete fabric 1-60 go down and 61-120 up, and within them each force has twelve in a row.
# Force: the grip was regulated to a mean reading of the taxels, not to newtons; `force_n` holds that reading in
# hundreds of counts, which distinguishes and orders forces, and is no force in newtons. Direction: +π/2 up, −π/2 down.

CPM = ('cpm/taxels', _taxels(16), 'count')
ROW_S = 0.028
# The finger speeds up along a quarter sine in the time that it then takes for 47 mm, slides 500 mm, and slows down
# likewise (`setDuration`, `setTimeMax` of the published controller).
RAMP_M, STEADY_M = 0.03 * math.pi / 2, 0.5


def _fabricslide_order(
    grating: str | None, grating_force: str, grating_speed: str, grating_repeat: str, *fabric: str
) -> tuple[str, tuple[Any, ...]]:
    named = (grating, grating_force, grating_speed, grating_repeat) if grating else fabric
    name, force, speed, repeat = named
    return str(name), (int(speed) > 0, int(force), abs(int(speed)), int(repeat))


def _fabricslide_slide(order: tuple[Any, ...], recorded: AnyArray) -> SteadySlide:
    up, counts, speed_mm_s, _ = order
    speed_m_s = speed_mm_s / 1000.0
    first, last = (round(way / speed_m_s / ROW_S) for way in (RAMP_M, RAMP_M + STEADY_M))
    # A run that is not of that length, as those over gratings, is taken as it is.
    steady = range(first, last) if first < last <= len(recorded) else None
    # The taxels come after the time (ms) and two proximities.
    return recorded[:, 3:19], speed_m_s, counts / 100.0, math.pi / 2 if up else -math.pi / 2, steady


# --------------------
# ntp21: a 9-taxel MEMS array over 21 textures at several speeds and forces, one bag each ('texture00').
#
# Source: github LIMB-UCF/NTP ("Neuromorphic Real-time Tactile Perception Invariant to Contact Dynamics"), joined into
# one `slides.npz` with a key `textureNNN/speedSSS/forceF.F` (mm/s, N over contact) for each slide. Slides are numbered
# by speed, and by force within a speed. The recorded stamps jitter by half a sample while the samples are evenly spaced
# (read so, the speeds agree better with each other): each slide is read as evenly spaced from its first stamp to its
# last, and resampled from its rate (310 to 323 Hz) to 320 Hz by a cubic spline. `force_n` is that beyond contact.

NTP21_TAXELS = 9
TIME = 10  # column of the time, s; the one between is auxiliary and of unknown meaning: left out
RATE_HZ = 320.0
SLOWEST = 10.0  # times the nominal duration; a time stamp that is wrong would need any number of samples


def _ntp21_slide(order: tuple[Any, ...], recorded: AnyArray) -> SteadySlide:
    speed_mm_s, force_n = order
    samples = evenly(np.asarray(recorded[:, :NTP21_TAXELS], dtype=float), float(recorded[-1, TIME] - recorded[0, TIME]))
    return samples, speed_mm_s / 1000.0, force_n, math.nan, None


def evenly(samples: Array, duration_s: float) -> Array:
    """Return samples, evenly spaced over a duration, at 320 Hz, (n, n_channels)."""
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 – nothing else in this package needs scipy

    if not 0 < duration_s <= SLOWEST * len(samples) / RATE_HZ:
        raise ValueError(f'{len(samples)} samples lasted {duration_s:g} s, at {RATE_HZ:g} Hz')
    sample_times = np.linspace(0.0, duration_s, len(samples))
    grid = np.arange(int(duration_s * RATE_HZ) + 1) / RATE_HZ
    values: Array = CubicSpline(sample_times, samples, axis=0)(grid)
    return values


# --------------------
# fingersense: the finger of fabricslide over the same fabrics on several dates, one bag a date ('2021-05-31').
#
# Source: github wngfra/fingerSense (Apache-2.0) with its history, joined into `2021-02_03.npz` and `2021-05_06.npz`
# with a key `date/Fabric/forceN/speedmms[/repeat]` for each slide. Slides of a fabric are numbered by date, then force,
# speed and repeat. Direction: +π/2 for speeds above 0, −π/2 below. Forces are as the keys name them; those of 100 and
# more (23 May) are hardly newtons. No rate is published. Rows of a slide grow by 28 (May) to 32 (February) m over the
# speed in m/s; at 50 Hz that is a distance of 0.56 to 0.64 m, and the same finger slides 0.594 m in fabricslide.

NOMINAL_HZ = 50.0
FREE_FRACTION = 0.2  # of the load that is reached in a tenth of the slide: below, the finger is not in contact


def _fingersense_slide(order: tuple[Any, ...], recorded: AnyArray) -> SteadySlide:
    _, force_n, speed_mm_s, _ = order
    load = recorded.mean(axis=1)
    touching = np.flatnonzero(load > FREE_FRACTION * np.quantile(load, 0.9))
    steady = range(int(touching[0]), int(touching[-1]) + 1) if len(touching) else None
    return recorded, abs(speed_mm_s) / 1000.0, force_n, math.copysign(math.pi / 2, speed_mm_s), steady


# --------------------
# Data sets of `texture import`.

import_biotac20 = PublicSet(
    'material*.npz', r'(material\d+)/(slide\d+)/frames',
    order=lambda material, slide: (material, (slide,)), slide=_biotac20_slide,
    number=lambda order: int(order[0].removeprefix('slide')), others=r'.*',
)  # fmt: skip
IMPORTS: Mapping[str, PublicSet] = {
    'biotac20': import_biotac20,
    'ntp21': PublicSet(
        'slides.npz', r'slides/([^/]+)/speed(\d+(?:\.\d+)?)/force(\d+(?:\.\d+)?)',
        order=lambda texture, speed, force: (texture, (float(speed), float(force))),
        # The published signal has no unit.
        slide=_steady('signal', partial(_signal, 'ntp/array', _taxels(NTP21_TAXELS), '', RATE_HZ), _ntp21_slide),
    ),
    'fabricslide': PublicSet(
        'runs.npz', r'runs/(?:grating/([^/]+?)_F(\d+)_V(-?\d+)mmps_(\d+)|([^/]+)/F(\d+)/V(-?\d+)/(\d+))',
        order=_fabricslide_order,
        slide=_steady('signal_static', partial(_signal, *CPM, 1.0 / ROW_S), _fabricslide_slide),
    ),
    'fingersense': PublicSet(
        '2021-*.npz', r'[^/]+/(\d{4}-\d\d-\d\d)/([^/]+)/(\d+(?:\.\d+)?)N/(-?\d+)mms(?:/(\d+))?',
        order=lambda date, fabric, force, speed, repeat: (fabric, (date, float(force), int(speed), int(repeat or 0))),
        slide=_steady('signal_static', partial(_signal, *CPM, NOMINAL_HZ), _fingersense_slide),
        dated=True,
    ),
    # 20 materials × 30 slides of 1.5 s by 60 capacitive taxels of an iCub (Gao et al. 2020), numbered by the fold of
    # the authors; no order in time is known. The file has times and patches of the skin mixed up: read as 75 times of 6
    # patches of 10 taxels, the mean step from one time to the next falls from 7.1 to 0.19.
    'icub20': PublicSet(
        'slides.npz', r'slides/([^/]+)/val_(\d+)_(\d+)',
        order=lambda material, fold, number: (material, (int(fold), int(number))),
        slide=_steady(
            'signal_static', partial(_signal, 'roboskin/taxels', tuple(map(str, range(60))), '', 50.0),
            lambda _, recorded: (recorded.reshape(75, 6, 10).swapaxes(0, 1).reshape(75, 60), *UNKNOWN, None),
        ),
    ),
    # Contact sound of 29 textures that a tool strokes by hand (Strese et al. 2014), as stored in the history of
    # github shinolab/vibrotactile-autoencoder, joined into one file. The whole stroke counts as sliding; speed, force
    # and direction are unknown.
    'lmt29': PublicSet(
        'recordings.npz', r'recordings/(G\d[^/]*)/(\d+)',
        order=lambda texture, number: (texture, (int(number),)),
        slide=_steady(
            'signal', partial(_signal, 'lmt/microphone', ('sound',), 'count', 22_050.0),
            lambda _, recorded: (recorded[:, :1], *UNKNOWN, None), motion='',
        ),
    ),
}  # fmt: skip
