"""The sensors that are read in the load benchmark, and what each emulated device sends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

DAQ = '{channels: [' + ', '.join(f'{{name: c{i}, unit: count}}' for i in range(8)) + ']}'
Feed = Callable[[Any, int, int], None]


@dataclass(frozen=True)
class RigCase:
    """How a device is fed, and how what arrives is to be read.

    Sample i of `topic` holds `slope` · i and a constant, modulo `modulus`.

    Parameters
    ----------
    topic
        The fast one.
    ticks_per_s, samples_per_tick
        How often the device is fed, and how many samples that makes.
    feed
        Called with the device, the first tick and the number of ticks.
    units
        Unit of each topic that must come: one for all of its channels, or one for each.
    config
        Settings of the sensor, so that it publishes counts.
    """

    topic: str
    ticks_per_s: float
    samples_per_tick: int
    feed: Feed
    units: Mapping[str, str | tuple[str, ...]]
    modulus: int
    slope: int = 1
    config: str = ''

    @property
    def rate_hz(self) -> float:
        """Samples a second on `topic`."""
        return self.ticks_per_s * self.samples_per_tick


def feed_tsf85(shape: tuple[int, ...]) -> Feed:
    """Return what feeds a TSF-85 with images of a shape; for two fingers both feel the same."""

    def feed(device: Any, first: int, ticks: int) -> None:
        numbers = np.arange(first, first + ticks) % 1000
        dynamic = np.repeat(numbers[:, None], 2, axis=1) if len(shape) == 2 else numbers
        device.advance(dynamic.astype(np.int16), np.full((1, *shape), first % 1000, dtype=np.uint16))

    return feed


def feed_biotac(slots: int, fingers: int) -> Feed:
    """Return what feeds a board with frames of so many slots."""

    def feed(device: Any, first: int, ticks: int) -> None:
        numbers = np.arange(first * slots, (first + ticks) * slots) % 4096
        device.advance(np.repeat(numbers[:, None], fingers, axis=1).astype(np.uint16).reshape(ticks, slots, fingers))

    return feed


def feed_alike(channels: int, kind: type[np.generic]) -> Feed:
    """Return what feeds so many channels alike, with numbers of this type."""

    def feed(device: Any, first: int, ticks: int) -> None:
        numbers = np.arange(first, first + ticks) % 30_000
        device.sample(np.outer(numbers, np.ones(channels)).astype(kind))

    return feed


def feed_pvdf(device: Any, first: int, ticks: int) -> None:
    """Feed the film, and the force with every 64th tick.

    Parameters
    ----------
    device
        Emulated device.
    first
        Number of the first tick.
    ticks
        How many.
    """
    numbers = np.arange(first, first + ticks)
    device.sample((numbers % 30_000).astype(np.int16), (numbers[numbers % 64 == 0] // 64 % 30_000).astype(np.int16))


def feed_papillarray(arrays: int) -> Feed:
    """Return what feeds a hub with so many arrays; it samples four times as often as it sends."""

    def feed(device: Any, first: int, ticks: int) -> None:
        numbers = np.repeat(np.arange(first, first + ticks) % 30_000, 4)
        device.sample(np.broadcast_to(numbers[:, None, None, None], (4 * ticks, arrays, 9, 6)).astype(np.float64))

    return feed


def tsf85(prefix: str = '', shape: tuple[int, ...] = (28,)) -> RigCase:
    """Return how a TSF-85 is fed."""
    imu = ('m/s²',) * 3 + ('rad/s',) * 3
    units: dict[str, str | tuple[str, ...]] = {
        f'{prefix}signal': 'count',
        f'{prefix}signal_static': 'count',
        f'{prefix}imu': imu,
    }
    return RigCase(f'{prefix}signal', 1000.0, 1, feed_tsf85(shape), units, 1000)


def biotac(prefix: str = '', slots: int = 44, fingers: int = 1) -> RigCase:
    """Return how a BioTac is fed.

    Parameters
    ----------
    prefix
        What the topics begin with.
    slots
        Slots of a frame.
    fingers
        Number of BioTacs.

    Returns
    -------
    RigCase
    """
    units: dict[str, str | tuple[str, ...]] = {f'{prefix}signal': 'count', f'{prefix}signal_static': 'count'}
    return RigCase(f'{prefix}signal', 4400 / slots, slots // 2, feed_biotac(slots, fingers), units, 4096, slope=2)


def papillarray(prefix: str = '', arrays: int = 1) -> RigCase:
    """Return how a hub of PapillArrays is fed."""
    units: dict[str, str | tuple[str, ...]] = {
        f'{prefix}signal': (*('N',) * 3, *('mm',) * 3) * 9,
        f'{prefix}wrench': (*('N',) * 3, *('N mm',) * 3),
    }
    feed = feed_papillarray(arrays)
    return RigCase(f'{prefix}signal', 250.0, 1, feed, units, 30_000, config='{rate_hz: 250}')


CASES: Mapping[str, RigCase] = {
    'tsf85': tsf85(),
    'tsf85_pair': tsf85('finger1/', (2, 28)),
    'tsf85_3x4': tsf85(shape=(12,)),
    'biotac': biotac(),
    'biotac_sp': biotac(slots=54),
    'biotac_hand': biotac('finger2/', fingers=3),
    'daq': RigCase('signal', 2500.0, 1, feed_alike(8, np.int16), {'signal': 'count'}, 30_000, config=DAQ),
    'pvdf': RigCase(
        'signal', 4096.0, 1, feed_pvdf, {'signal': 'pC', 'signal_static': 'N'}, 30_000,
        config='{film_gain_pc: 1.0, force_gain_n: 1.0}',
    ),
    'anyskin': RigCase(
        'signal', 250.0, 1, feed_alike(15, np.float64), {'signal': 'µT', 'temperature': '°C'}, 30_000,
        config='{rate_hz: 250.0, temperature: true}',
    ),
    'papillarray': papillarray(),
    'papillarray_pair': papillarray('finger1/', 2),
}  # fmt: skip
