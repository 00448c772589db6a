# SPDX-License-Identifier: Apache-2.0
"""Importers of the public recordings."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from texture_core.cli import progress
from texture_core.config import Arrays, open_regular, unknown_name
from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, AnyArray, Array, ExplorationState, Phase, TactileSignal
from texture_recordings.bags import BagWriter
from texture_recordings.dataset import parse_selection

# --------------------
# A slide of the BioTac data set, and how the finger moved in it.

FRAME_NS = 10_000_000  # a frame every 10 ms; its recorded times jitter by the host's scheduling
# Every slide is cut to the length of the shortest material, or its length would tell the label. The finger runs at
# speed from the first frame on.
SLIDE_FRAMES = 600
LONGEST_S = 1000.0  # of one slide; frames that are missing are counted, however many


LAST_EPOCH_S = 2.0**31 - 1e6  # a stamp of ROS has 31 bits for seconds, and all slides follow each other
NORMAL_FORCE = 2  # column of `wrench`: y of the tool, the one component that presses whatever the direction of travel


@dataclass(frozen=True, eq=False)
class BiotacSlide:
    """One slide as recorded; the fields of the arrays are named as in the files.

    Examples
    --------
    >>> frames, velocity, wrench = np.zeros((3, 44)), np.zeros((5, 4)), np.zeros((5, 7))
    >>> slide = BiotacSlide('material01', '1', frames, np.array([0.0, 0.01, 0.05]), velocity, wrench, epoch=0.0)
    >>> slide.frames.shape
    (3, 44)
    """

    surface: str
    slide: str
    frames: AnyArray  # (n_frames, 44) counts
    frame_time: AnyArray  # (n_frames,) s
    velocity: AnyArray  # (m, 4): time s, x, y, z m/s
    wrench: AnyArray  # (k, 7): time s, fx, fy, fz N, tx, ty, tz N m
    epoch: float  # Unix time of the first frame, s

    def __post_init__(self) -> None:
        columns = {'frames': 44, 'velocity': 4, 'wrench': 7}
        wrong = [name for name, count in columns.items() if np.shape(getattr(self, name))[1:] != (count,)]
        if wrong or self.frame_time.shape != (len(self.frames),) or not len(self.frames):
            raise ValueError(f"the arrays of '{self.slide}' have the shapes of no slide")
        if not np.isfinite(self.frame_time).all() or np.ptp(self.frame_time) > LONGEST_S:
            raise ValueError(f"the frames of '{self.slide}' are not within {LONGEST_S:g} s")
        if not 0 <= self.epoch < LAST_EPOCH_S:
            raise ValueError(f"'{self.slide}' began at {self.epoch:g} s; Unix time from 0 is needed")


@dataclass(frozen=True, eq=False)
class BiotacSlideMotion:
    """Speed, direction and normal force over the time of one slide.

    Examples
    --------
    >>> velocity, wrench = np.array([[0.0, 0.0, 0.02, 0.0]]), np.zeros((1, 7))
    >>> slide = BiotacSlide('cork', '1', np.zeros((1, 44)), np.zeros(1), velocity, wrench, epoch=0.0)
    >>> BiotacSlideMotion.of(slide).state(0, 0, 10).speed_m_s
    0.02
    """

    named: ExplorationState
    velocity: AnyArray
    wrench: AnyArray

    @classmethod
    def of(cls, recording: BiotacSlide) -> BiotacSlideMotion:
        """Return the motion of a slide, without what was not measured."""
        velocity = recording.velocity[np.isfinite(recording.velocity).all(axis=1)]
        wrench = recording.wrench[np.isfinite(recording.wrench).all(axis=1)]
        x, y = velocity[:, 1:3].mean(axis=0) if len(velocity) else (math.nan, math.nan)
        name = f'{recording.surface}/{recording.slide}'
        named = ExplorationState(
            0, name, 'linear_slide', Phase.SLIDE, direction_rad=math.atan2(y, x), surface=recording.surface
        )
        return cls(named, velocity, wrench)

    def state(self, start_ns: int, stamp_ns: int, end_ns: int) -> ExplorationState:
        """Return the state that holds from `stamp_ns` to `end_ns` of a slide that began at `start_ns`.

        Parameters
        ----------
        start_ns, stamp_ns, end_ns
            Times on one clock.

        Returns
        -------
        ExplorationState
        """
        time_s = (stamp_ns - start_ns) / NANOSECONDS
        speed = np.hypot(self.velocity[:, 1], self.velocity[:, 2])
        return replace(
            self.named,
            stamp_ns=stamp_ns,
            steady_s=(end_ns - stamp_ns) / NANOSECONDS,
            speed_m_s=_at(time_s, self.velocity[:, 0], speed),
            force_n=_at(time_s, self.wrench[:, 0], self.wrench[:, NORMAL_FORCE]),
            progress=(stamp_ns - start_ns) / (SLIDE_FRAMES * FRAME_NS),
        )


def _at(time_s: float, times: AnyArray, values: AnyArray) -> float:
    return float(np.interp(time_s, times, values)) if len(times) else math.nan


# --------------------
# The BioTac recordings of 20 materials × 40 slides, as labelled bags.
#
# Source: github dexrob/BioTac_slide_20_50 (Gao et al. 2020, "Supervised Autoencoder Joint Learning on Heterogeneous
# Tactile Sensory Data"), cut into one `materialNN.npz` a material.

PAC_PER_FRAME = 22
PAC_COLUMNS = slice(3, 3 + PAC_PER_FRAME)
STATIC_CHANNELS = ('tdc', 'tac', 'pdc', *(f'electrode{i}' for i in range(1, 20)))
STATIC_COLUMNS = (0, 1, 2, *range(25, 44))
BATCH_FRAMES = 2
STATE_BATCHES = 5  # a state every 0.1 s
LOST_AFTER_S = 0.025  # frame times jitter by up to 8 ms; a larger step is a loss
PAUSE_NS = NANOSECONDS
DELAY_NS = 100_000  # a batch is logged this long after its last sample
FIELDS = ('frames', 'frame_time', 'velocity', 'wrench')


def import_biotac20(
    source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = (), channels: str = 'all'
) -> list[Path]:
    """Write one bag a material, 'material01' and so on, from files materialNN.npz, and return their paths.

    The vibration is PAC at 2200 Hz, the slow channels have 100 Hz.
    """
    if channels not in ('fast', 'all'):
        raise InvalidData(f"channels are '{channels}'; 'fast' or 'all' is needed")
    files = {path.stem: path for path in sorted(Path(source).glob('material*.npz'))}
    if not files:
        raise InvalidData(f"no files materialNN.npz in '{source}'; give the folder that holds them")
    for name in materials:
        if name not in files:
            raise unknown_name(name, files, 'material')
    wanted = parse_selection(slides)
    names = materials or list(files)
    return [
        _import_material(files[name], Path(out) / name, wanted, channels)
        for name in progress(names, 'import materials', len(names))
    ]


def _import_material(file: Path, out: Path, wanted: frozenset[int] | None, channels: str) -> Path:
    recordings = list(_recordings(file, wanted))
    if not recordings:
        raise InvalidData(f"'{file}' has none of the slides asked for; it has 1 to 40")
    ready_ns, next_frame = 0, 0
    with BagWriter(out) as bag:
        for recording in recordings:
            # Where the recording computer's clock went back, a slide follows the one before.
            start_ns = max(round(recording.epoch * 1000) * 1_000_000, ready_ns)
            indices = next_frame + frame_indices(recording.frame_time[:SLIDE_FRAMES])
            _write_slide(bag, recording, start_ns, indices, channels)
            next_frame = int(indices[-1]) + 1
            ready_ns = start_ns + (next_frame - int(indices[0])) * FRAME_NS + PAUSE_NS
    return out


def _recordings(file: Path, wanted: frozenset[int] | None) -> Iterator[BiotacSlide]:
    try:
        with open_regular(file) as opened:
            content = Arrays(opened)
            for slide in sorted({key.split('/')[0] for key in content.names}):
                if wanted is None or int(slide.removeprefix('slide')) in wanted:
                    fields = {name: content[f'{slide}/{name}'] for name in FIELDS}
                    yield BiotacSlide(file.stem, slide, epoch=float(content[f'{slide}/epoch']), **fields)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidData(f"'{file}' is no file of this data set: {error}; fetch it again") from error


def frame_indices(frame_time: AnyArray) -> AnyArray:
    """Return the running index of each frame on the 10 ms grid: it jumps where frames are missing.

    Parameters
    ----------
    frame_time : (n_frames,)
        Time of each frame, s, rising.

    Returns
    -------
    (n_frames,)
        Whole numbers, the first 0.
    """
    steps = np.diff(np.asarray(frame_time, dtype=float))
    missing = np.where(steps > LOST_AFTER_S, np.rint(steps / (FRAME_NS / NANOSECONDS)) - 1, 0)
    return np.concatenate([[0], np.cumsum(1 + missing)]).astype(int)


def restore_sign(rectified: AnyArray) -> Array:
    """Return a vibration from its rectified samples, up to one sign for the whole.

    The sign of each sample is the one that continues the straight line through the two before it.

    Parameters
    ----------
    rectified : (n_samples,)
        |PAC − offset|, ≥ 0, a whole slide.

    Returns
    -------
    (n_samples,)
        In the unit of the samples.
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


def _write_slide(bag: BagWriter, recording: BiotacSlide, start_ns: int, indices: AnyArray, channels: str) -> None:
    """Write one slide: a state, then the samples of each batch, then the end; `indices` number the frames."""
    frames = recording.frames[: len(indices)]
    vibration = restore_sign(frames[:, PAC_COLUMNS].ravel()).astype(np.float32)[:, None]
    static = frames[:, STATIC_COLUMNS].astype(np.float32)
    motion = BiotacSlideMotion.of(recording)
    stop_ns = start_ns + int(indices[-1] - indices[0] + 1) * FRAME_NS
    for count, part in enumerate(_batches(indices)):
        first = int(indices[part.start])
        stamp_ns = start_ns + (first - int(indices[0])) * FRAME_NS
        end_ns = stamp_ns + (part.stop - part.start) * FRAME_NS
        if count % STATE_BATCHES == 0:
            until_ns = min(stamp_ns + STATE_BATCHES * BATCH_FRAMES * FRAME_NS, stop_ns)
            bag.write('exploration', motion.state(start_ns, stamp_ns, until_ns), stamp_ns)
        fast = vibration[part.start * PAC_PER_FRAME : part.stop * PAC_PER_FRAME]
        bag.write('signal', _signal('pac', ('pac',), stamp_ns, first * PAC_PER_FRAME, fast), end_ns + DELAY_NS)
        if channels == 'all':
            slow = _signal('slow', STATIC_CHANNELS, stamp_ns, first, static[part])
            bag.write('signal_static', slow, end_ns + 2 * DELAY_NS)
    for count, phase in enumerate((Phase.LIFT, Phase.DONE)):
        after_ns = stop_ns + count * BATCH_FRAMES * FRAME_NS
        state = replace(motion.named, stamp_ns=after_ns, phase=phase, progress=1.0)
        bag.write('exploration', state, after_ns + 3 * DELAY_NS)


def _batches(indices: AnyArray) -> Iterator[slice]:
    """Yield slices of consecutive frames, BATCH_FRAMES long or shorter before a gap and at the end."""
    starts = [0, *(np.flatnonzero(np.diff(indices) > 1) + 1).tolist(), len(indices)]
    for begin, end in pairwise(starts):
        for first in range(begin, end, BATCH_FRAMES):
            yield slice(first, min(first + BATCH_FRAMES, end))


def _signal(part: str, channels: tuple[str, ...], stamp_ns: int, first: int, samples: AnyArray) -> TactileSignal:
    rate_hz = 2200.0 if part == 'pac' else 100.0
    return TactileSignal(
        stamp_ns, f'biotac/{part}', channels, ('count',) * len(channels), rate_hz, first, samples, 'biotac'
    )


# --------------------
# Write slides of evenly spaced samples at a constant speed and force, as labelled bags.

START_NS = 1_000_000_000 * NANOSECONDS
BATCH_S = 0.1


@dataclass(frozen=True, eq=False)
class SteadySlide:
    """One slide.

    Parameters
    ----------
    exploration_id, surface
        Name and label.
    samples : (n, n_channels)
        Evenly spaced.
    speed_m_s, force_n, direction_rad
        Of the finger; NaN if unknown.
    steady
        Samples in which the finger slides; before them it is in contact, after them it lifts. All if None.
    motion
        Name of the motion; '' if it is none of the catalogue.

    Examples
    --------
    >>> import numpy as np
    >>> SteadySlide('cork-1', 'cork', np.zeros((200, 1)), speed_m_s=0.05, force_n=1.0, direction_rad=0.0).surface
    'cork'
    """

    exploration_id: str
    surface: str
    samples: AnyArray
    speed_m_s: float
    force_n: float
    direction_rad: float
    steady: range | None = None
    motion: str = 'linear_slide'


@dataclass(frozen=True)
class ImportedStream:
    """The stream that all slides of a data set share: as in a `TactileSignal`.

    Examples
    --------
    >>> ImportedStream('signal', 'finger', ('pac',), 'count', 100.0).to_ns(50)  # half a second
    500000000
    """

    topic: str
    sensor: str
    channels: tuple[str, ...]
    unit: str
    rate_hz: float

    def to_ns(self, samples: int) -> int:
        """Return how long so many samples take."""
        return round(samples * NANOSECONDS / self.rate_hz)


def write_steady_slides(
    path: Path, stream: ImportedStream, slides: Iterable[SteadySlide], start_ns: int = START_NS
) -> Path:
    """Write a bag of slides, one after the other in the order given; the stamps are made up.

    A state is published at the start of each phase and guarantees its whole length: speed and force do not change.

    Parameters
    ----------
    path
        Of the new bag.
    stream
        Topic, sensor, channels and rate of the samples.
    slides
        In the order of their writing.
    start_ns
        Stamp of the first slide.

    Returns
    -------
    Path
        Of the bag.
    """
    first = 0
    with BagWriter(path) as bag:
        for slide in slides:
            start_ns = _write(bag, stream, slide, start_ns, first) + PAUSE_NS
            first += len(slide.samples)
    return path


def _write(bag: BagWriter, stream: ImportedStream, slide: SteadySlide, start_ns: int, first: int) -> int:
    """Write one slide; return its end."""
    count = len(slide.samples)
    steady = slide.steady or range(count)
    phases = [(Phase.CONTACT, range(steady.start)), (Phase.SLIDE, steady), (Phase.LIFT, range(steady.stop, count))]
    named = ExplorationState(
        0, slide.exploration_id, slide.motion, Phase.SLIDE, speed_m_s=slide.speed_m_s, force_n=slide.force_n,
        direction_rad=slide.direction_rad, surface=slide.surface,
    )  # fmt: skip
    for phase, part in phases:
        if len(part) or phase is not Phase.CONTACT:
            _write_phase(bag, stream, slide, replace(named, phase=phase), part=part, start_ns=start_ns, first=first)
    end_ns = start_ns + stream.to_ns(count)
    bag.write('exploration', replace(named, stamp_ns=end_ns, phase=Phase.DONE, progress=1.0), end_ns + 2 * DELAY_NS)
    return end_ns


def _write_phase(
    bag: BagWriter,
    stream: ImportedStream,
    slide: SteadySlide,
    state: ExplorationState,
    *,
    part: range,
    start_ns: int,
    first: int,
) -> None:
    begin_ns, end_ns = (start_ns + stream.to_ns(index) for index in (part.start, part.stop))
    progress = part.start / len(slide.samples)
    # A state before the first batch it covers, and after the last batch of the phase before.
    log_ns = begin_ns + (DELAY_NS if part.start else 0)
    guaranteed_s = (end_ns - begin_ns) / NANOSECONDS
    bag.write('exploration', replace(state, stamp_ns=begin_ns, steady_s=guaranteed_s, progress=progress), log_ns)
    step = max(1, round(BATCH_S * stream.rate_hz))
    for index in range(part.start, part.stop, step):
        samples = slide.samples[index : min(index + step, part.stop)].astype('float32')
        stamp_ns = start_ns + stream.to_ns(index)
        batch = TactileSignal(
            stamp_ns,
            stream.sensor,
            stream.channels,
            (stream.unit,) * len(stream.channels),
            stream.rate_hz,
            first + index,
            samples,
            stream.sensor,
        )
        bag.write(stream.topic, batch, start_ns + stream.to_ns(index + len(samples)) + DELAY_NS)


# --------------------
# A data set whose slides lie in .npz files, to one bag for each surface or session.


@dataclass(frozen=True)
class SlideFile:
    """What the files are called, and how their keys and arrays are read; slides are numbered in order of conditions.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from texture_recordings.dataset import find_slides
    >>> stream = ImportedStream('signal', 'finger', ('pac',), 'count', 100.0)
    >>> def place(key: str) -> tuple[str, int]:
    ...     return key.split('-')[0], int(key.split('-')[1])
    >>> def slide(key: str, surface: str, condition: int, samples: AnyArray) -> SteadySlide:
    ...     return SteadySlide(key, surface, samples, 0.05, 1.0, 0.0)
    >>> with TemporaryDirectory() as folder:
    ...     np.savez(f'{folder}/slides.npz', **{'cork-1': np.zeros((200, 1)), 'cork-2': np.zeros((200, 1))})
    ...     bags = SlideFile('slides.npz', stream, place, slide).write_bags(folder, f'{folder}/bags', '', ())
    ...     print([item.name for item in find_slides(bags)])
    ['cork/1', 'cork/2']
    """

    name: str  # or a pattern, such as '2021-*.npz'
    stream: ImportedStream
    place: Callable[[str], tuple[str, Any] | None]  # surface and condition of a key, None if it is no such key
    slide: Callable[[str, str, Any, AnyArray], SteadySlide]  # of key, surface, condition and array
    # Bag and stamp of its first slide, of surface and condition: a bag is a session
    session: Callable[[str, Any], tuple[str, int]] = lambda surface, _: (surface, START_NS)

    def write_bags(self, source: str | Path, out: str | Path, slides: str, surfaces: Sequence[str]) -> list[Path]:
        """Write the slides of each surface that `slides` names ('' for all), of all surfaces if none is named.

        Parameters
        ----------
        source
            Folder of the file.
        out
            Folder for the bags; made if missing.
        slides
            Numbers of the slides of each surface, such as '1-30'; '' for all.
        surfaces
            Labels of the surfaces; none for all.

        Returns
        -------
        list of Path
            Of the bags.

        Raises
        ------
        InvalidData, UnknownName
            If the folder `source` lacks the file, slides or a surface, or a bag exists already.
        """
        content, wanted = self._read(Path(source)), parse_selection(slides)
        found: defaultdict[str, list[tuple[Any, str]]] = defaultdict(list)
        for key in content:
            place = self.place(key)
            if place is None:
                raise InvalidData(f"'{self.name}' holds '{key}', which is no slide of this data set; fetch it again")
            found[place[0]].append((place[1], key))
        for name in surfaces:
            if name not in found:
                raise unknown_name(name, found, 'surface')
        sessions: defaultdict[tuple[str, int], list[tuple[str, str, Any]]] = defaultdict(list)
        for name in surfaces or sorted(found):
            for condition, key in _chosen(name, found[name], wanted):
                sessions[self.session(name, condition)].append((key, name, condition))
        ordered = sorted(sessions.items(), key=lambda item: item[0][1])
        return [
            write_steady_slides(
                Path(out) / bag, self.stream, (self._slide(*slide, content[slide[0]]) for slide in slides), start_ns
            )
            for (bag, start_ns), slides in progress(ordered, 'import bags', len(ordered))
        ]

    def _slide(self, key: str, surface: str, condition: Any, values: AnyArray) -> SteadySlide:
        try:
            return self.slide(key, surface, condition, values)
        except (ValueError, LookupError, ArithmeticError) as error:
            raise InvalidData(
                f"'{key}' of '{self.name}' is no slide of this data set: {error}; fetch it again"
            ) from error

    def _read(self, folder: Path) -> dict[str, AnyArray]:
        files = sorted(path for path in folder.glob(self.name) if path.is_file())
        if not files:
            raise InvalidData(f"no file {self.name} in '{folder}'; give the folder that holds it")
        return {key: values for file in files for key, values in _arrays(file).items()}


def _arrays(file: Path) -> dict[str, AnyArray]:
    try:
        with open_regular(file) as opened:
            content = Arrays(opened)
            return {key: _slide(key, content[key]) for key in content.names}
    except (OSError, ValueError, KeyError) as error:
        raise InvalidData(f"'{file}' is no file of this data set: {error}; fetch it again") from error


def _slide(key: str, values: AnyArray) -> AnyArray:
    values = values[:, None] if values.ndim == 1 else values
    if values.ndim != 2 or values.dtype.kind not in 'iuf' or len(values) < 2 or not np.isfinite(values).all():
        raise ValueError(
            f"'{key}' has shape {values.shape}, type {values.dtype}; finite (n_samples, n_channels) are needed"
        )
    return values


def _chosen(surface: str, slides: list[tuple[Any, str]], wanted: frozenset[int] | None) -> list[tuple[Any, str]]:
    chosen = [slide for number, slide in enumerate(sorted(slides), 1) if wanted is None or number in wanted]
    if not chosen:
        raise InvalidData(f"'{surface}' has none of the slides asked for; it has 1 to {len(slides)}")
    return chosen


# --------------------
# The slides of a 16-taxel capacitive finger over fabrics and printed gratings, as labelled bags.
#
# Source: github wngfra/FabricSlide (Wang et al. 2022, "Fabric Classification Using a Finger-Shaped Tactile Sensor via
# Robotic Sliding", MIT licence), joined into one `runs.npz`.

FABRIC = re.compile(r'([^/]+)/F(\d+)/V(-?\d+)/(\d+)')
GRATING = re.compile(r'grating/([^/]+?)_F(\d+)_V(-?\d+)mmps_(\d+)')
FABRICSLIDE_TAXELS = slice(3, 19)  # after the time (ms) and two proximities
ROW_S = 0.028
FABRICSLIDE_STREAM = ImportedStream(
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


def fabricslide_place(key: str) -> tuple[str, SlideRun] | None:
    """Return fabric or grating of a key, and the run."""
    match = GRATING.fullmatch(key) or FABRIC.fullmatch(key)
    if not match:
        return None
    speed = int(match[3])
    return match[1], SlideRun(speed > 0, int(match[2]), abs(speed), int(match[4]))


def fabricslide_slide(key: str, surface: str, run: SlideRun, recorded: AnyArray) -> SteadySlide:
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
        key, surface, recorded[:, FABRICSLIDE_TAXELS], speed_m_s, run.counts / COUNTS_PER_FORCE, direction_rad, steady
    )


FABRICSLIDE_DATA = SlideFile('runs.npz', FABRICSLIDE_STREAM, fabricslide_place, fabricslide_slide)


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
    return FABRICSLIDE_DATA.write_bags(source, out, slides, materials)


# --------------------
# The slides of a 9-taxel MEMS array over 21 textures at several speeds and forces, as labelled bags.
#
# Source: github LIMB-UCF/NTP ("Neuromorphic Real-time Tactile Perception Invariant to Contact Dynamics"), joined into
# one
# `slides.npz` with a key `textureNNN/speedSSS/forceF.F` (mm/s, N over contact) for each slide.

KEY = re.compile(r'([^/]+)/speed(\d+(?:\.\d+)?)/force(\d+(?:\.\d+)?)')
NTP21_TAXELS = 9
TIME = 10  # column of the time, s; the one between is auxiliary and of unknown meaning: left out
RATE_HZ = 320.0
SLOWEST = 10.0  # times the nominal duration; a time stamp that is wrong would ask for any number of samples
# The published signal has no unit.
NTP21_STREAM = ImportedStream(
    'signal', 'ntp/array', tuple(f'taxel{n}' for n in range(1, NTP21_TAXELS + 1)), '', RATE_HZ
)


class SlideCondition(NamedTuple):
    """How one slide was made; sorted as the slides are numbered: by speed, then by force.

    Examples
    --------
    >>> sorted([SlideCondition(20.0, 0.5), SlideCondition(10.0, 1.0)])[0].speed_mm_s  # the slowest comes first
    10.0
    """

    speed_mm_s: float
    force_n: float


def ntp21_place(key: str) -> tuple[str, SlideCondition] | None:
    """Return texture and condition of a key."""
    match = KEY.fullmatch(key)
    return (match[1], SlideCondition(float(match[2]), float(match[3]))) if match else None


def ntp21_slide(key: str, texture: str, condition: SlideCondition, recorded: AnyArray) -> SteadySlide:
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
    samples = evenly(np.asarray(recorded[:, :NTP21_TAXELS], dtype=float), float(recorded[-1, TIME] - recorded[0, TIME]))
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


NTP21_DATA = SlideFile('slides.npz', NTP21_STREAM, ntp21_place, ntp21_slide)


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
    return NTP21_DATA.write_bags(source, out, slides, materials)


# --------------------
# The slides of a 16-taxel capacitive finger over the same fabrics on several dates, one labelled bag a date.
#
# Source: github wngfra/fingerSense (Apache-2.0) with its history, joined into `2021-02_03.npz` and `2021-05_06.npz`
# with a key `date/Fabric/forceN/speedmms[/repeat]` for each slide.

FINGERSENSE = re.compile(r'(\d{4}-\d\d-\d\d)/([^/]+)/(\d+(?:\.\d+)?)N/(-?\d+)mms(?:/(\d+))?')
# No rate is published. Rows of a slide grow by 28 (May) to 32 (February) m over the speed in m/s; at 50 Hz that is a
# way of 0.56 to 0.64 m, and the same finger slides 0.594 m in fabricslide.
NOMINAL_HZ = 50.0
FINGERSENSE_STREAM = ImportedStream(
    'signal_static', 'cpm/taxels', tuple(f'taxel{number}' for number in range(1, 17)), 'count', NOMINAL_HZ
)
FREE_SHARE = 0.2  # of the load that is reached in a tenth of the slide: below, the finger is not in contact


class DatedRun(NamedTuple):
    """How one slide was made; sorted as the slides are numbered: by date, then force, speed and repeat.

    Examples
    --------
    >>> sorted([DatedRun('2021-05-31', 2.0, 10, 0), DatedRun('2021-05-27', 4.0, 10, 0)])[0].date
    '2021-05-27'
    """

    date: str
    force_n: float
    speed_mm_s: int
    repeat: int


def fingersense_place(key: str) -> tuple[str, DatedRun] | None:
    """Return fabric of a key, and the run."""
    match = FINGERSENSE.fullmatch(key)
    return (match[2], DatedRun(match[1], float(match[3]), int(match[4]), int(match[5] or 0))) if match else None


def fingersense_slide(key: str, surface: str, run: DatedRun, recorded: AnyArray) -> SteadySlide:
    """Return a slide, given its rows as recorded.

    Parameters
    ----------
    key
        Name of the slide in the file.
    surface
        Label of the fabric or grating.
    run
        Date, force, speed and repeat.
    recorded : (n_rows, 16)
        The taxels.

    Returns
    -------
    SteadySlide
        It slides from the first row in contact to the last.
    """
    load = recorded.mean(axis=1)
    touching = np.flatnonzero(load > FREE_SHARE * np.quantile(load, 0.9))
    steady = range(int(touching[0]), int(touching[-1]) + 1) if len(touching) else None
    direction_rad = math.copysign(math.pi / 2, run.speed_mm_s)
    return SteadySlide(key, surface, recorded, abs(run.speed_mm_s) / 1000.0, run.force_n, direction_rad, steady)


def _fingersense_session(_surface: str, run: DatedRun) -> tuple[str, int]:
    midnight = datetime.fromisoformat(run.date).replace(tzinfo=timezone.utc)
    return run.date, round(midnight.timestamp()) * NANOSECONDS


FINGERSENSE_DATA = SlideFile(
    '2021-*.npz', FINGERSENSE_STREAM, fingersense_place, fingersense_slide, _fingersense_session
)


def import_fingersense(
    source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = (), channels: str = 'all'
) -> list[Path]:
    """Write one bag a date ('2021-05-31'), so that a session is a date, from all 2021-*.npz, and return their paths.

    The slides of a fabric are numbered by date, then force, speed and repeat. No rate is published: rows are written at
    a nominal 50 Hz, on `signal_static`; there is no vibration, so `channels` must be 'all'. Direction: +π/2 for speeds
    above 0, −π/2 below. Forces are as the keys name them; those of 100 and more (23 May) are hardly newtons. The states
    say `contact` until the taxels carry a load and `lift` once they carry none.
    """
    if channels != 'all':
        raise InvalidData(f"channels are '{channels}'; this finger has slow taxels alone, import 'all'")
    return FINGERSENSE_DATA.write_bags(source, out, slides, materials)


# --------------------
# Contact sound of a tool that strokes 29 textures by hand, as labelled bags.
#
# Source: the LMT haptic texture database (Strese et al. 2014) as it stands in the history of github
# shinolab/vibrotactile-autoencoder, joined into one `recordings.npz` with a key `G1Texture[VersionN]/NN` a stroke.

STROKE = re.compile(r'(G\d[^/]*)/(\d+)')
LMT29_STREAM = ImportedStream('signal', 'lmt/microphone', ('sound',), 'count', 22_050.0)


def lmt29_place(key: str) -> tuple[str, int] | None:
    """Return texture and number of a key."""
    match = STROKE.fullmatch(key)
    return (match[1], int(match[2])) if match else None


def lmt29_slide(key: str, texture: str, _number: int, recorded: AnyArray) -> SteadySlide:
    """Return a stroke, given its samples (n, 1): by hand, so speed, force and direction are unknown."""
    return SteadySlide(key, texture, recorded[:, :1], math.nan, math.nan, math.nan, motion='')


LMT29_DATA = SlideFile('recordings.npz', LMT29_STREAM, lmt29_place, lmt29_slide)


def import_lmt29(
    source: str | Path, out: str | Path, slides: str = '', materials: Sequence[str] = (), channels: str = 'all'
) -> list[Path]:
    """Write one bag a texture, 'G4Bamboo' and so on, from recordings.npz, and return their paths.

    Sound at 22 050 Hz on `signal`, as recorded: the whole stroke counts as sliding. Fast channels and all are the same.
    """
    if channels not in ('fast', 'all'):
        raise InvalidData(f"channels are '{channels}'; 'fast' or 'all' is needed")
    return LMT29_DATA.write_bags(source, out, slides, materials)


# --------------------
# Data sets that `texture import` knows.


# Each takes the folder with the files of the data set, the folder for the bags, which slides of each material ('' for
# all), names of materials (none for all) and 'fast' or 'all' channels, and returns the paths of the bags. InvalidData
# is raised if the source lacks files or slides, the channels are not there, or a bag exists already.
Importer = Callable[..., list[Path]]

IMPORTS: Mapping[str, Importer] = {
    'biotac20': import_biotac20,  # 20 materials × 40 slides, BioTac on a robot arm
    'ntp21': import_ntp21,  # 21 textures × speeds × forces, 9-taxel MEMS array
    'fabricslide': import_fabricslide,  # 7 fabrics × forces × speeds × 2 directions and gratings, 16 capacitive taxels
    'fingersense': import_fingersense,  # fabrics on several dates in 2021, 16 capacitive taxels
    'lmt29': import_lmt29,  # contact sound of 29 textures, a tool stroked by hand
}
