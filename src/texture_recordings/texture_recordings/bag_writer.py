"""Write recordings: rosbag2 folders with MCAP inside, which `ros2 bag` opens too; no ROS is needed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zlib import crc32

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from texture_core.errors import InvalidData
from texture_recordings.bag_limits import CHECKSUM_FROM_END, CHUNK_CHECKSUM_AT, FOOTER_BYTES
from texture_recordings.bags import RawMessage
from texture_recordings.cdr import TYPES, encode, typestore
from texture_recordings.topic_names import short_name

FOREVER = QosTime(2147483647, 4294967295)


def _offered(reliability: QosReliability, durability: QosDurability, depth: int) -> list[Qos]:
    keep, lively = QosHistory.KEEP_LAST, QosLiveliness.AUTOMATIC
    return [Qos(keep, depth, reliability, durability, FOREVER, FOREVER, lively, FOREVER, False)]


# The same as texture_core.ros.qos, for `ros2 bag play`; by the last part of the topic's name.
QOS: Mapping[str, list[Qos]] = {
    'signal': _offered(QosReliability.BEST_EFFORT, QosDurability.VOLATILE, 200),
    'signal_static': _offered(QosReliability.BEST_EFFORT, QosDurability.VOLATILE, 200),
    'exploration': _offered(QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, 200),
    'features': _offered(QosReliability.RELIABLE, QosDurability.VOLATILE, 200),
    'texture': _offered(QosReliability.RELIABLE, QosDurability.VOLATILE, 50),
    'roughness': _offered(QosReliability.RELIABLE, QosDurability.VOLATILE, 50),
}


class BagWriter:
    """Write a new bag; use it in a `with` block, at the end of which the bag is complete.

    Parameters
    ----------
    path
        Folder to make; nothing may exist there.
    namespace
        Put before topics that do not start with '/': 'signal' becomes '/left/signal' in '/left'.

    Each chunk carries its checksum, and `flush` ends one: a bag whose writer was killed is read up to the last.

    Raises
    ------
    InvalidData
        If something exists at `path`, or it cannot be made.

    Examples
    --------
    >>> import numpy as np
    >>> from tempfile import TemporaryDirectory
    >>> from texture_core.signal import TactileSignal
    >>> from texture_recordings.bags import read_bag
    >>> batch = TactileSignal(5, 'finger', ('pac',), (), 1000.0, 0, np.array([[1.0], [2.0]], dtype=np.float32))
    >>> with TemporaryDirectory() as folder:
    ...     with BagWriter(f'{folder}/bag') as bag:
    ...         bag.write('signal', batch, log_ns=7)
    ...     [(topic, log_ns, signal)] = read_bag(f'{folder}/bag')
    >>> topic, log_ns, signal.samples[:, 0].tolist()
    ('signal', 7, [1.0, 2.0])
    """

    def __init__(self, path: str | Path, namespace: str = '/') -> None:
        self.path = Path(path)
        self._namespace = '/' + namespace.strip('/')
        self._connections: dict[tuple[str, str], Connection] = {}
        if self.path.exists():
            raise InvalidData(f"'{path}' exists already; a bag is never overwritten, name another or remove it")
        self._writer = Writer(self.path, version=8, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        try:
            self._writer.open()
        except OSError as error:
            raise InvalidData(f"no bag can be made at '{path}': {error.strerror}; name another place") from error
        storage: Any = self._writer.storage
        self._storage = storage
        self._close_chunk = self._storage.close_chunk  # without a checksum
        self._storage.close_chunk = self._close_with_checksum

    def write(self, topic: str, value: Any, log_ns: int) -> None:
        """Write a data class of texture_core as received at `log_ns`.

        Parameters
        ----------
        topic
            Name of the topic, such as 'signal'.
        value
            Data class of texture_core that has a message.
        log_ns
            Time at which it is logged, ns.
        """
        self.write_raw(RawMessage(topic, TYPES[type(value)], log_ns, encode(value)))

    def write_raw(self, message: RawMessage) -> None:
        """Write a message that is CDR already."""
        key = message.topic, message.msgtype
        if key not in self._connections:
            self._connections[key] = self._connect(*key)
        self._writer.write(self._connections[key], message.log_ns, message.data)

    def flush(self) -> None:
        """Bring to the disk what was written: it can be read whatever happens to this process or machine."""
        if self._storage.chunk.msgs:
            self._storage.close_chunk()
        self._storage.bio.flush()
        os.fsync(self._storage.bio.fileno())

    def close(self) -> None:
        """Complete the bag."""
        self._writer.close()
        with self._storage.path.open('r+b') as file:
            file.seek(-FOOTER_BYTES, os.SEEK_END)
            file.seek(int.from_bytes(file.read(FOOTER_BYTES)[9:17], 'little'))
            checksum = crc32(file.read()[:-CHECKSUM_FROM_END])
            file.seek(-CHECKSUM_FROM_END, os.SEEK_END)
            file.write(checksum.to_bytes(4, 'little'))

    def _close_with_checksum(self) -> None:
        file, checksum = self._storage.bio, crc32(self._storage.chunk.bio.getbuffer())
        at = file.tell() + CHUNK_CHECKSUM_AT
        self._close_chunk()
        file.seek(at)
        file.write(checksum.to_bytes(4, 'little'))
        file.seek(0, os.SEEK_END)

    def _connect(self, topic: str, msgtype: str) -> Connection:
        name = topic if topic.startswith('/') else f'{self._namespace.rstrip("/")}/{topic}'
        qos = QOS.get(short_name(name), [])
        return self._writer.add_connection(name, msgtype, typestore=typestore(), offered_qos_profiles=qos)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
