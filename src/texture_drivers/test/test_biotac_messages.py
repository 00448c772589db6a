# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, TactileSignal, lost_samples
from texture_drivers.biotac import MESSAGES, BioTacMessageConverter

START_NS = 1_700_000_000_000_000_000
HAND, ALL = MESSAGES['BioTacHand'], MESSAGES['BiotacAll']


def header(stamp_ns: int) -> SimpleNamespace:
    sec, nanosec = divmod(stamp_ns, NANOSECONDS)
    return SimpleNamespace(stamp=SimpleNamespace(sec=sec, nanosec=nanosec), frame_id='')


def hand(stamp_ns: int, **changes: Any) -> SimpleNamespace:
    """A BioTacHand with BioTacs at positions 1 and 3."""
    fingers = [
        SimpleNamespace(
            bt_serial=f'BT-{position}',
            bt_position=position,
            tdc_data=1000 * position,
            tac_data=2000,
            pdc_data=2200,
            pac_data=np.arange(22, dtype=np.uint16) + 100 * position,
            electrode_data=np.arange(1, 20, dtype=np.uint16),
        )
        for position in (1, 3)
    ]
    for name, value in changes.items():
        setattr(fingers[0], name, value)
    # The times of the samples in these messages are wrong, so nothing may depend on them.
    return SimpleNamespace(header=header(stamp_ns), hand_id='left', bt_data=fingers, bt_time=None)


def biotac_all(stamp_ns: int, n_pac: int) -> SimpleNamespace:
    finger = SimpleNamespace(
        pac0=1, pac1=2, pac=list(range(n_pac)), pdc=2200, tac=2000, tdc=1000, electrodes=list(range(1, 20))
    )
    return SimpleNamespace(header=header(stamp_ns), tactiles=[finger] * 5)


def run(stream: BioTacMessageConverter, messages: list[Any]) -> dict[str, list[TactileSignal]]:
    topics: dict[str, list[TactileSignal]] = {'signal': [], 'signal_static': []}
    for message in messages:
        for topic, batch in stream.update(message).items():
            topics[topic].append(batch)
    return topics


def test_biotac_hand_gives_pac_with_the_times_of_its_slots() -> None:
    stream = BioTacMessageConverter(HAND, finger=2, frame_id='tip')
    topics = run(stream, [hand(START_NS + n * 10_000_000) for n in range(50)])
    pac, slow = topics['signal'][-1], topics['signal_static'][-1]
    frame_start_ns = START_NS + 48 * 10_000_000  # the stamp of a message is the end of its frame
    assert abs(slow.stamp_ns - frame_start_ns) < 1000
    assert abs(pac.stamp_ns - frame_start_ns - 227_273) < 1000
    assert pac.samples[:, 0].tolist() == list(range(300, 322))
    assert slow.samples[0].tolist() == [3000, 2000, 2200, *range(1, 20)]
    assert slow.channels[:4] == ('tdc', 'tac', 'pdc', 'electrode1')
    assert (pac.sampling_rate_hz, slow.sampling_rate_hz, pac.frame_id) == (2200.0, 100.0, 'tip')
    assert (pac.units, slow.units) == (('count',), ('count',) * 22)
    assert lost_samples(topics['signal']) == lost_samples(topics['signal_static']) == 0
    assert stream.serial == 'BT-3'


def test_jitter_of_the_host_makes_no_losses_and_hardly_moves_the_times() -> None:
    rng = np.random.default_rng(0)
    late_ns = rng.integers(0, 4_000_000, 300)
    topics = run(BioTacMessageConverter(HAND), [hand(START_NS + n * 10_000_000 + int(late_ns[n])) for n in range(300)])
    assert lost_samples(topics['signal']) == 0
    stamps = np.array([batch.stamp_ns for batch in topics['signal']][100:])
    assert np.ptp(stamps - 10_000_000 * np.arange(len(stamps))) < 1_000_000


def test_a_gap_in_the_stamps_is_a_loss() -> None:
    stream = BioTacMessageConverter(HAND)
    topics = run(stream, [hand(START_NS + n * 10_000_000) for n in range(60) if not 30 <= n < 34])
    assert lost_samples(topics['signal']) == stream.lost == 4 * 22
    assert lost_samples(topics['signal_static']) == 4


@pytest.mark.parametrize('period_ns', [9_000_000, 10_000_000])
def test_biotac_all_may_hold_any_number_of_pac_samples(period_ns: int) -> None:
    # Two samples a millisecond, published at 111 or 100 Hz.
    stamps = [START_NS + n * period_ns for n in range(100)]
    counts = [period_ns // 500_000 + (1, -1, 0)[n % 3] for n in range(100)]
    topics = run(BioTacMessageConverter(ALL), [biotac_all(*item) for item in zip(stamps, counts, strict=True)])
    pac = topics['signal']
    assert [len(batch.samples) for batch in pac] == counts[-len(pac) :]
    assert lost_samples(pac) == 0
    assert pac[-1].sampling_rate_hz == 2000.0
    # The last sample is as new as the message.
    assert abs(pac[-1].stamp_ns + (counts[-1] - 1) * 500_000 - stamps[-1]) < 1_500_000
    assert topics['signal_static'][-1].samples[0].tolist() == [1000, 2000, 2200, *range(1, 20)]


@pytest.mark.parametrize(
    ('message', 'finger', 'sentence'),
    [
        (hand(START_NS), 1, r'fingers \[0, 2\]'),
        (hand(START_NS, pac_data=[1] * 21), 0, '21 PAC samples'),
        (hand(START_NS, electrode_data=[1] * 24), 0, '24 electrodes'),
    ],
)
def test_a_message_that_does_not_fit_is_refused_in_one_sentence(message: Any, finger: int, sentence: str) -> None:
    with pytest.raises(InvalidData, match=sentence):
        BioTacMessageConverter(HAND, finger).update(message)
