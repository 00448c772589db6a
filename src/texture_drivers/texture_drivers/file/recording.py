"""Recordings in files that other programs write: CSV, WAV, NumPy."""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from texture_core.arrays import AnyArray, Samples
from texture_core.errors import InvalidData
from texture_core.files import MB, Arrays, Budget, open_regular, read_array, take_all
from texture_drivers.file.csv_recording import load_csv
from texture_drivers.file.file_recording import FileRecording

MAX_BYTES = 2000 * MB  # of a file
# What the readers of numpy and scipy raise at files that are damaged or something else, found by trying.
READ_ERRORS = (
    ValueError,
    KeyError,
    EOFError,
    ArithmeticError,
    MemoryError,
    NotImplementedError,
    UnboundLocalError,
    TypeError,
    struct.error,
)


def load_recording(path: Path) -> FileRecording:
    """Return what is recorded in a .csv, .wav, .npy or .npz file; no file can run code.

    Raises
    ------
    InvalidData
        If there is no such file, or it holds something else.
    """
    if path.suffix.lower() not in LOADERS:
        raise InvalidData(f"recording '{path}' ends in '{path.suffix}'; allowed are {', '.join(LOADERS)}")
    try:
        with open_regular(path) as file:
            recording = LOADERS[path.suffix.lower()](file)
    except OSError as error:
        raise InvalidData(f"recording '{path}' cannot be read: {error.strerror or error}; give another path") from error
    except READ_ERRORS as error:
        raise InvalidData(f"recording '{path}' is not usable: {error}") from error
    return _checked(path, recording)


def _checked(path: Path, recording: FileRecording) -> FileRecording:
    if recording.samples.ndim != 2 or 0 in recording.samples.shape:
        raise InvalidData(
            f"recording '{path}' holds an array of shape {recording.samples.shape}; (n_samples, n_channels) is needed"
        )
    if recording.channels and len(recording.channels) != recording.samples.shape[1]:
        raise InvalidData(
            f"recording '{path}' names {len(recording.channels)} channels and has {recording.samples.shape[1]}; "
            'one name for each is needed'
        )
    if recording.rate_hz is not None and not 0 < recording.rate_hz < np.inf:
        raise InvalidData(f"recording '{path}' has a rate of {recording.rate_hz} Hz; one above 0 is needed")
    return recording


def load_wav(file: BinaryIO) -> FileRecording:
    """Return a WAV file; whole numbers are scaled so that full scale is 1."""
    from scipy.io import wavfile  # noqa: PLC0415 – no other recording and no device needs scipy

    with warnings.catch_warnings():
        warnings.simplefilter('ignore', wavfile.WavFileWarning)  # chunks of no interest
        rate_hz, samples = wavfile.read(io.BytesIO(take_all(file, MAX_BYTES)))
    if samples.dtype == np.uint8:  # WAV's only unsigned format
        samples = samples.astype(np.int16) - 128
        full_scale = 128.0
    else:
        full_scale = -float(np.iinfo(samples.dtype).min) if samples.dtype.kind == 'i' else 1.0
    return FileRecording(_columns(samples) / full_scale, float(rate_hz))


def load_npy(file: BinaryIO) -> FileRecording:
    """Return an array of shape (n_samples, n_channels) or (n_samples,)."""
    return FileRecording(_columns(read_array(file, Budget(_values_bytes(file)))))


def _values_bytes(file: BinaryIO) -> int:
    """Return how many bytes the values may come to as float64, of a file that is not compressed: a byte each at least.

    The file is at its beginning afterwards.
    """
    n_bytes = file.seek(0, io.SEEK_END)
    file.seek(0)
    return 8 * n_bytes


def load_npz(file: BinaryIO) -> FileRecording:
    """Return the array `samples`; `rate_hz` and `channels` beside it are used if they are there.

    Raises
    ------
    ValueError
        If there is no array of real numbers called `samples`.
    """
    arrays = Arrays(file)
    if 'samples' not in arrays:
        raise ValueError(f"it holds {', '.join(arrays.names) or 'nothing'}; an array called 'samples' is needed")
    rate_hz = float(arrays['rate_hz']) if 'rate_hz' in arrays else None
    channels = tuple(str(name) for name in np.atleast_1d(arrays['channels'])) if 'channels' in arrays else ()
    return FileRecording(_columns(arrays['samples']), rate_hz, channels)


def _columns(values: AnyArray) -> Samples:
    if values.dtype.kind not in 'iuf':
        raise ValueError(f'it holds values of type {values.dtype}; real numbers are needed')
    samples: Samples = values.astype(np.float64, copy=False)
    return samples[:, None] if samples.ndim == 1 else samples


LOADERS: Mapping[str, Callable[[BinaryIO], FileRecording]] = {
    '.csv': load_csv,
    '.wav': load_wav,
    '.npy': load_npy,
    '.npz': load_npz,
}
