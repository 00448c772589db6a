"""The BioTac recordings of 20 materials × 40 slides, as labelled bags.

Source: github dexrob/BioTac_slide_20_50 (Gao et al. 2020, "Supervised Autoencoder Joint Learning on Heterogeneous
Tactile Sensory Data"), cut into one `materialNN.npz` a material.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData
from texture_core.exploration import Phase
from texture_core.files import Arrays, open_regular
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_recordings.bag_writer import BagWriter
from texture_recordings.importers.biotac20_slide import FRAME_NS, SLIDE_FRAMES, BiotacSlide, BiotacSlideMotion
from texture_recordings.slides import parse_selection

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
    return [_import_material(files[name], Path(out) / name, wanted, channels) for name in (materials or list(files))]


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
