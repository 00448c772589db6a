"""Where slides begin and end in a table: by a column, by pauses, by time, or found in the signal."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_recordings.tables.table_columns import SlideBorders

DETECTION_BATCH = 1000  # rows


@dataclass(frozen=True, eq=False)
class SlideRows:
    """The rows of one stream by which slides are cut.

    Parameters
    ----------
    time_s : (n,)
        Time of each row; NaN where it is unknown.
    samples : (n, n_channels)
        Values.
    rate_hz
        Sampling rate.
    keys : (n,)
        Values of the column that changes between slides, if one does.
    place
        File, for sentences.

    Examples
    --------
    >>> time_s = np.array([0.0, 0.1, 0.2, 5.0, 5.1])  # a pause after the third row
    >>> rows = SlideRows(time_s, np.zeros((5, 1)), rate_hz=10.0, keys=None, place='run.csv')
    >>> spans(rows, SlideBorders(by='pause', pause_s=1.0))
    [slice(0, 3, None), slice(3, 5, None)]
    """

    time_s: Array
    samples: Array
    rate_hz: float
    keys: AnyArray | None
    place: str


def spans(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    """Return the rows of each slide in their order, the ends that are left out already taken away."""
    found = RULES[borders.by](rows, borders)
    skip, drop = (round(seconds * rows.rate_hz) for seconds in (borders.start_s, borders.end_s))
    return [slice(span.start + skip, max(span.start + skip, span.stop - drop)) for span in found]


def _by_file(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    return [slice(0, len(rows.time_s))]


def _by_column(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    if rows.keys is None:
        return _by_file(rows, borders)  # a field of the file's name: it holds for the whole file
    edges = [0, *(np.flatnonzero(rows.keys[1:] != rows.keys[:-1]) + 1).tolist(), len(rows.keys)]
    chosen = [
        slice(first, last) for first, last in pairwise(edges) if _slides_at(str(rows.keys[first]), borders.values)
    ]
    if not chosen:
        raise InvalidData(
            f"'{rows.place}': column '{borders.column}' has none of the values "
            f'{", ".join(borders.values) or "but empty"}; it has {", ".join(np.unique(rows.keys)[:5].tolist())}'
        )
    return chosen


def _slides_at(value: str, wanted: Sequence[str]) -> bool:
    """Return whether the finger slides at a value of the column: one of those wanted, or any that is not empty."""
    return any(fnmatch.fnmatchcase(value, one) or value == one for one in wanted) if wanted else value != ''


def _by_pause(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    known = np.flatnonzero(np.isfinite(rows.time_s))
    steps = np.diff(rows.time_s[known])
    edges = [0, *known[1:][(steps >= borders.pause_s) | (steps < 0)].tolist(), len(rows.time_s)]
    return [slice(first, last) for first, last in pairwise(edges)]


def _by_time(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    since = rows.time_s - np.nanmin(rows.time_s)
    number = np.floor(np.maximum.accumulate(np.nan_to_num(since, nan=0.0)) / borders.length_s + 1e-9)
    edges = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), len(number)]
    whole = (1.0 - 1e-6) * borders.length_s * rows.rate_hz - 1.0
    return [slice(a, b) for a, b in pairwise(edges) if b - a >= whole]


def _by_detection(rows: SlideRows, borders: SlideBorders) -> list[slice]:
    # These need scipy, which reading and writing of bags does without.
    from texture_features.segmentation.segments import SegmentationParams  # noqa: PLC0415
    from texture_features.segmentation.slide_segmenter import segment_recording  # noqa: PLC0415

    params = SegmentationParams(on=borders.on, off=borders.off, min_duration_s=max(borders.min_s, 0.05))
    channels = tuple(str(number) for number in range(rows.samples.shape[1]))
    samples = rows.samples.astype(np.float32)
    batches = [
        TactileSignal(
            round(first / rows.rate_hz * NANOSECONDS), '', channels, (), rows.rate_hz, first,
            samples[first : first + DETECTION_BATCH],
        )
        for first in range(0, len(samples), DETECTION_BATCH)
    ]  # fmt: skip
    states = segment_recording({'signal': batches}, params)
    return [
        slice(*(round(at * rows.rate_hz / NANOSECONDS) for at in (s.stamp_ns, s.stamp_ns + s.steady_s * NANOSECONDS)))
        for s in states
        if s.phase.value == 'slide'
    ]


RULES: Mapping[str, Callable[[SlideRows, SlideBorders], list[slice]]] = {
    'file': _by_file,
    'column': _by_column,
    'pause': _by_pause,
    'time': _by_time,
    'detection': _by_detection,
}
