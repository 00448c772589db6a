# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Importers of the public recordings."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from texture_core.cli import progress
from texture_core.config import Arrays, open_regular, unknown_name
from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, AnyArray, Array, ExplorationState, Phase, TactileSignal
from texture_recordings.bags import DELAY_NS, PAUSE_NS, START_NS, BagWriter, slide_batches
from texture_recordings.slides import parse_selection

# --------------------
# The BioTac recordings of 20 materials × 40 slides, as labelled bags.
#
# Source: github dexrob/BioTac_slide_20_50 (Gao et al. 2020, "Supervised Autoencoder Joint Learning on Heterogeneous
# Tactile Sensory Data"), cut into one `materialNN.npz` a material.

FRAME_NS = 10_000_000  # a frame every 10 ms; its recorded times jitter by the host's scheduling
# Every slide is cut to the length of the shortest material, or its length would reveal the label. The finger runs at
# speed from the first frame on.
SLIDE_FRAMES = 600
LONGEST_S = 1000.0  # of one slide; frames that are missing are counted, however many
LAST_EPOCH_S = 2.0**31 - 1e6  # a stamp of ROS has 31 bits for seconds, and all slides follow each other
NORMAL_FORCE = 2  # column of `wrench`: y of the tool, the one component that presses whatever the direction of travel
# Arrays of a slide, and their columns: counts; m/s behind the time, s; N and N m behind the time.
COLUMNS = {'frames': 44, 'velocity': 4, 'wrench': 7}
PAC_PER_FRAME = 22
PAC_COLUMNS = slice(3, 3 + PAC_PER_FRAME)
STATIC_CHANNELS = ('tdc', 'tac', 'pdc', *(f'electrode{i}' for i in range(1, 20)))
STATIC_COLUMNS = (0, 1, 2, *range(25, 44))
BIOTAC_BATCH_S = 0.02
STATE_BATCHES = 5  # a state every 0.1 s
LOST_AFTER_S = 0.025  # frame times jitter by up to 8 ms; a larger step is a loss


def import_biotac20(source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = ()) -> list[Path]:
    """Write one bag a material, 'material01' and so on, from files materialNN.npz, and return their paths.

    The vibration is PAC at 2200 Hz, the slow channels have 100 Hz.
    """
    files = {path.stem: path for path in sorted(Path(source).glob('material*.npz'))}
    if not files:
        raise InvalidData(f"no files materialNN.npz in '{source}'; give the folder that holds them")
    for name in materials:
        if name not in files:
            raise unknown_name(name, files, 'material')
    wanted = parse_selection(slides)
    names = materials or list(files)
    return [
        _import_material(files[name], Path(out) / name, wanted)
        for name in progress(names, 'import materials', len(names))
    ]


def _import_material(file: Path, out: Path, wanted: frozenset[int] | None) -> Path:
    recordings = list(_recordings(file, wanted))
    if not recordings:
        raise InvalidData(f"'{file}' has none of the requested slides; it has 1 to 40")
    ready_ns, next_frame = 0, 0
    with BagWriter(out) as bag:
        for slide, arrays in recordings:
            # Where the recording computer's clock went back, a slide follows the one before.
            start_ns = max(round(float(arrays['epoch']) * 1000) * 1_000_000, ready_ns)
            indices = next_frame + frame_indices(arrays['frame_time'][:SLIDE_FRAMES])
            _write_slide(bag, f'{file.stem}/{slide}', arrays, start_ns, indices)
            next_frame = int(indices[-1]) + 1
            ready_ns = start_ns + (next_frame - int(indices[0])) * FRAME_NS + PAUSE_NS
    return out


def _recordings(file: Path, wanted: frozenset[int] | None) -> Iterator[tuple[str, dict[str, AnyArray]]]:
    """Yield slides and their arrays: those of COLUMNS, the times of the frames and the Unix time of the first, s."""
    try:
        with open_regular(file) as opened:
            content = Arrays(opened)
            for slide in sorted({key.split('/')[0] for key in content.names}):
                if wanted is None or int(slide.removeprefix('slide')) in wanted:
                    arrays = {name: content[f'{slide}/{name}'] for name in (*COLUMNS, 'frame_time', 'epoch')}
                    count, frame_time = len(arrays['frames']), arrays['frame_time']
                    wrong = [name for name, columns in COLUMNS.items() if arrays[name].shape[1:] != (columns,)]
                    if wrong or frame_time.shape != (count,) or not count:
                        raise ValueError(f"the arrays of '{slide}' have the shapes of no slide")
                    if not np.isfinite(frame_time).all() or np.ptp(frame_time) > LONGEST_S:
                        raise ValueError(f"the frames of '{slide}' are not within {LONGEST_S:g} s")
                    if not 0 <= float(arrays['epoch']) < LAST_EPOCH_S:
                        raise ValueError(f"'{slide}' began at {arrays['epoch']} s; Unix time from 0 is needed")
                    yield slide, arrays
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidData(f"'{file}' is not a file of this data set: {error}; fetch it again") from error


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


def _write_slide(bag: BagWriter, name: str, arrays: Mapping[str, AnyArray], start_ns: int, indices: AnyArray) -> None:
    """Write one slide: a state every 0.1 s, the samples, then the end; `indices` number the frames."""
    frames, first = arrays['frames'][: len(indices)], int(indices[0])
    places = indices - first
    vibration, fast_places = restore_sign(frames[:, PAC_COLUMNS].ravel())[:, None], np.arange(PAC_PER_FRAME)
    streams = {
        'signal': (_like('pac', ('pac',), first), vibration, np.add.outer(PAC_PER_FRAME * places, fast_places).ravel()),
        'signal_static': (_like('slow', STATIC_CHANNELS, first), frames[:, STATIC_COLUMNS], places),
    }
    messages: list[tuple[int, str, Any]] = []
    for topic, (like, samples, index) in streams.items():
        batches = list(slide_batches(like, samples, index, start_ns, batch_s=BIOTAC_BATCH_S))
        messages += [(batch.end_ns + DELAY_NS, topic, batch) for batch in batches]
    velocity, wrench = (arrays[key][np.isfinite(arrays[key]).all(axis=1)] for key in ('velocity', 'wrench'))
    x, y = velocity[:, 1:3].mean(axis=0) if len(velocity) else (math.nan, math.nan)
    named = ExplorationState(
        0, name, 'linear_slide', Phase.SLIDE, direction_rad=math.atan2(y, x), surface=name.partition('/')[0]
    )
    stop_ns = start_ns + (int(places[-1]) + 1) * FRAME_NS
    for stamp_ns in (batch.stamp_ns for batch in batches[::STATE_BATCHES]):
        since_s = (stamp_ns - start_ns) / NANOSECONDS
        speed_m_s = _at(since_s, velocity[:, 0], np.hypot(velocity[:, 1], velocity[:, 2]))
        force_n = _at(since_s, wrench[:, 0], wrench[:, NORMAL_FORCE])
        steady_s = min(STATE_BATCHES * BIOTAC_BATCH_S, (stop_ns - stamp_ns) / NANOSECONDS)
        state = replace(
            named, stamp_ns=stamp_ns, steady_s=steady_s, speed_m_s=speed_m_s, force_n=force_n,
            progress=since_s / (SLIDE_FRAMES * FRAME_NS / NANOSECONDS),
        )  # fmt: skip
        messages.append((stamp_ns, 'exploration', state))
    for count, phase in enumerate((Phase.LIFT, Phase.DONE)):
        after_ns = stop_ns + count * round(BIOTAC_BATCH_S * NANOSECONDS)
        messages.append(
            (after_ns + 2 * DELAY_NS, 'exploration', replace(named, stamp_ns=after_ns, phase=phase, progress=1.0))
        )
    bag.write_all(messages)


def _at(time_s: float, times: AnyArray, values: AnyArray) -> float:
    """Return what was measured at a time; NaN if nothing was."""
    return float(np.interp(time_s, times, values)) if len(times) else math.nan


def _like(part: str, channels: tuple[str, ...], first_frame: int) -> TactileSignal:
    per_frame = PAC_PER_FRAME if part == 'pac' else 1
    none, units = np.empty((0, len(channels)), dtype=np.float32), ('count',) * len(channels)
    rate_hz = per_frame * NANOSECONDS / FRAME_NS
    return TactileSignal(0, f'biotac/{part}', channels, units, rate_hz, per_frame * first_frame, none, 'biotac')


# --------------------
# Sets whose slides lie in .npz files, of evenly spaced samples at a constant speed and force.


class SteadySlide(NamedTuple):
    """One slide: samples (n, n_channels), conditions (NaN if unknown), and the samples in which the finger slides.

    Before `steady` the finger is in contact, after it lifts; all samples belong to the slide if it is None.
    """

    samples: AnyArray
    speed_m_s: float
    force_n: float
    direction_rad: float
    steady: range | None = None


def _one_bag_each(surface: str, _order: Sequence[Any]) -> tuple[str, int]:
    return surface, START_NS


@dataclass(frozen=True)
class SlideSet:
    r"""A data set of one stream: what its files and slides are called, and how its arrays are read.

    Call it with the folder of the files, the folder for the bags, the numbers of the slides of each surface ('' for
    all), and surfaces (none for all); it returns the bags.
    """

    files: str  # a name or a pattern, such as '2021-*.npz'
    key: str  # pattern of the names of the arrays
    topic: str
    sensor: str
    channels: tuple[str, ...]
    unit: str
    rate_hz: float
    order: Callable[..., tuple[str, tuple[Any, ...]]]  # groups of the key → surface, and what its slides are sorted by
    slide: Callable[[tuple[Any, ...], AnyArray], SteadySlide]  # of that order and the array
    session: Callable[[str, tuple[Any, ...]], tuple[str, int]] = _one_bag_each  # name and start of the bag, ns
    motion: str = 'linear_slide'

    def __call__(
        self, source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = ()
    ) -> list[Path]:
        """Write the bags, and return their paths."""
        arrays, wanted = self._read(Path(source)), parse_selection(slides)
        found: defaultdict[str, list[tuple[tuple[Any, ...], str]]] = defaultdict(list)
        for key in arrays:
            match = re.fullmatch(self.key, key)
            if match is None:
                raise InvalidData(
                    f"'{self.files}' holds '{key}', which is not a slide of this data set; fetch it again"
                )
            surface, order = self.order(*match.groups())
            found[surface].append((order, key))
        for name in materials:
            if name not in found:
                raise unknown_name(name, found, 'surface')
        bags: defaultdict[tuple[str, int], list[tuple[str, str, tuple[Any, ...]]]] = defaultdict(list)
        for surface in materials or sorted(found):
            numbered = enumerate(sorted(found[surface]), 1)
            chosen = [slide for number, slide in numbered if wanted is None or number in wanted]
            if not chosen:
                raise InvalidData(f"'{surface}' has none of the requested slides; it has 1 to {len(found[surface])}")
            for order, key in chosen:
                bags[self.session(surface, order)].append((key, surface, order))
        ordered = sorted(bags.items(), key=lambda item: item[0][1])
        return [
            self._write(Path(out) / name, start_ns, ((*one, arrays[one[0]]) for one in members))
            for (name, start_ns), members in progress(ordered, 'import bags', len(ordered))
        ]

    def _read(self, folder: Path) -> dict[str, AnyArray]:
        files = sorted(path for path in folder.glob(self.files) if path.is_file())
        if not files:
            raise InvalidData(f"no file {self.files} in '{folder}'; give the folder that holds it")
        return {key: rows for file in files for key, rows in _slides_in(file).items()}

    def _write(self, path: Path, start_ns: int, slides: Iterable[tuple[str, str, tuple[Any, ...], AnyArray]]) -> Path:
        """Write slides one after the other; the stamps are made up, and speed and force do not change in a phase."""
        first = 0
        with BagWriter(path) as bag:
            for key, surface, order, array in slides:
                try:
                    slide = self.slide(order, array)
                except (ValueError, LookupError, ArithmeticError) as error:
                    raise InvalidData(
                        f"'{key}' of '{self.files}' is not a slide of this data set: {error}; fetch it again"
                    ) from error
                named = ExplorationState(
                    0, key, self.motion, Phase.SLIDE, speed_m_s=slide.speed_m_s, force_n=slide.force_n,
                    direction_rad=slide.direction_rad, surface=surface,
                )  # fmt: skip
                start_ns = self._write_slide(bag, slide, named, start_ns, first) + PAUSE_NS
                first += len(slide.samples)
        return path

    def _write_slide(
        self, bag: BagWriter, slide: SteadySlide, named: ExplorationState, start_ns: int, first: int
    ) -> int:
        """Write one slide; return its end."""
        count = len(slide.samples)
        steady = slide.steady or range(count)
        at_ns = [start_ns + round(index * NANOSECONDS / self.rate_hz) for index in range(count + 1)]
        none, units = np.empty((0, len(self.channels)), dtype=np.float32), (self.unit,) * len(self.channels)
        like = TactileSignal(0, self.sensor, self.channels, units, self.rate_hz, first, none, self.sensor)
        batches = slide_batches(like, slide.samples, np.arange(count), start_ns, edges=(steady.start, steady.stop))
        messages: list[tuple[int, str, Any]] = [(batch.end_ns + DELAY_NS, self.topic, batch) for batch in batches]
        phases = [(Phase.CONTACT, 0, steady.start), (Phase.SLIDE, steady.start, steady.stop)]
        for phase, begin, end in [*phases[not steady.start :], (Phase.LIFT, steady.stop, count)]:
            guaranteed_s = (at_ns[end] - at_ns[begin]) / NANOSECONDS
            state = replace(named, stamp_ns=at_ns[begin], phase=phase, steady_s=guaranteed_s, progress=begin / count)
            # A state before the first batch it covers, and after the last batch of the phase before.
            messages.append((at_ns[begin] + (2 * DELAY_NS if begin else 0), 'exploration', state))
        done = replace(named, stamp_ns=at_ns[count], phase=Phase.DONE, progress=1.0)
        bag.write_all([*messages, (at_ns[count] + 3 * DELAY_NS, 'exploration', done)])
        return at_ns[count]


def _slides_in(file: Path) -> dict[str, AnyArray]:
    try:
        with open_regular(file) as opened:
            content = Arrays(opened)
            return {key: _rows_of(key, content[key]) for key in content.names}
    except (OSError, ValueError, KeyError) as error:
        raise InvalidData(f"'{file}' is not a file of this data set: {error}; fetch it again") from error


def _rows_of(key: str, values: AnyArray) -> AnyArray:
    values = values[:, None] if values.ndim == 1 else values
    if values.ndim != 2 or values.dtype.kind not in 'iuf' or len(values) < 2 or not np.isfinite(values).all():
        raise ValueError(
            f"'{key}' has shape {values.shape}, type {values.dtype}; finite (n_samples, n_channels) are needed"
        )
    return values


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
    return SteadySlide(recorded[:, 3:19], speed_m_s, counts / 100.0, math.pi / 2 if up else -math.pi / 2, steady)


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
    return SteadySlide(samples, speed_mm_s / 1000.0, force_n, math.nan)


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
    return SteadySlide(recorded, abs(speed_mm_s) / 1000.0, force_n, math.copysign(math.pi / 2, speed_mm_s), steady)


def _fingersense_session(_surface: str, order: Sequence[Any]) -> tuple[str, int]:
    midnight = datetime.fromisoformat(order[0]).replace(tzinfo=timezone.utc)
    return order[0], round(midnight.timestamp()) * NANOSECONDS


# --------------------
# Data sets of `texture import`, each called as `import_biotac20` is.

Importer = Callable[..., list[Path]]
IMPORTS: Mapping[str, Importer] = {
    'biotac20': import_biotac20,  # 20 materials × 40 slides, BioTac on a robot arm
    'ntp21': SlideSet(
        'slides.npz', r'([^/]+)/speed(\d+(?:\.\d+)?)/force(\d+(?:\.\d+)?)',
        'signal', 'ntp/array', _taxels(NTP21_TAXELS), '', RATE_HZ,  # the published signal has no unit
        order=lambda texture, speed, force: (texture, (float(speed), float(force))), slide=_ntp21_slide,
    ),
    'fabricslide': SlideSet(
        'runs.npz', r'grating/([^/]+?)_F(\d+)_V(-?\d+)mmps_(\d+)|([^/]+)/F(\d+)/V(-?\d+)/(\d+)',
        'signal_static', 'cpm/taxels', _taxels(16), 'count', 1.0 / ROW_S,
        order=_fabricslide_order, slide=_fabricslide_slide,
    ),
    'fingersense': SlideSet(
        '2021-*.npz', r'(\d{4}-\d\d-\d\d)/([^/]+)/(\d+(?:\.\d+)?)N/(-?\d+)mms(?:/(\d+))?',
        'signal_static', 'cpm/taxels', _taxels(16), 'count', NOMINAL_HZ,
        order=lambda date, fabric, force, speed, repeat: (fabric, (date, float(force), int(speed), int(repeat or 0))),
        slide=_fingersense_slide, session=_fingersense_session,
    ),
    # Contact sound of 29 textures that a tool strokes by hand (Strese et al. 2014), as stored in the history of
    # github shinolab/vibrotactile-autoencoder, joined into one file. The whole stroke counts as sliding; speed, force
    # and direction are unknown.
    'lmt29': SlideSet(
        'recordings.npz', r'(G\d[^/]*)/(\d+)', 'signal', 'lmt/microphone', ('sound',), 'count', 22_050.0,
        order=lambda texture, number: (texture, (int(number),)),
        slide=lambda _order, recorded: SteadySlide(recorded[:, :1], math.nan, math.nan, math.nan), motion='',
    ),
}  # fmt: skip
