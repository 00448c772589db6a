"""Readers of tables by the ending of a file's name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_recordings.tables.readers.csv_file import read_csv
from texture_recordings.tables.readers.hdf5_file import read_hdf5
from texture_recordings.tables.readers.mat_file import read_mat
from texture_recordings.tables.readers.message_bag import read_message_bag
from texture_recordings.tables.readers.numpy_file import read_npy, read_npz
from texture_recordings.tables.readers.parquet_file import read_parquet
from texture_recordings.tables.readers.wav_file import read_wav
from texture_recordings.tables.table import TableReader

READERS: Mapping[str, TableReader] = {
    '.csv': read_csv,
    '.tsv': read_csv,
    '.txt': read_csv,
    '.npz': read_npz,
    '.npy': read_npy,
    '.mat': read_mat,
    '.wav': read_wav,
    '.h5': read_hdf5,
    '.hdf5': read_hdf5,
    '.parquet': read_parquet,
}
BAG = 'bag'
# What `texture import` is given a mapping for.
MAPPED: Mapping[str, Mapping[str, TableReader]] = {'table': READERS, 'bag': {BAG: read_message_bag}}
