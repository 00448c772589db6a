# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from texture_core.framing import FrameDecoder
from texture_drivers.biotac import LAYOUTS, decode, sampling_command
from texture_simulation.devices.fingers import commands, encode_replies, reply_frame, serials_frame


@pytest.mark.parametrize('kind', LAYOUTS)
def test_the_emulator_and_the_driver_agree_on_every_value(kind: str) -> None:
    layout = LAYOUTS[kind]
    n_slots = len(layout.slots)
    values = np.resize(np.arange(4096), (100, n_slots, 2)).astype(np.uint16)
    assert commands(layout.electrodes).tolist() == [sampling_command(channel) for channel in layout.slots]
    replies = decode(encode_replies(values).tobytes(), layout, fingers=2)
    assert not replies.damaged.any()
    assert (replies.pac == values[:, 1::2].reshape(-1, 2)).all()
    assert (replies.slow == values[:, list(layout.slow_slots)]).all()


def test_an_absent_biotac_is_a_line_that_stays_low() -> None:
    values = np.full((1, 44, 2), 100, dtype=np.uint16)
    replies = decode(encode_replies(values, absent=[0]).tobytes(), LAYOUTS['biotac'], fingers=2)
    assert replies.damaged.tolist() == [44, 0]


def test_the_driver_reads_the_emulators_frames() -> None:
    values = np.zeros((44, 3), dtype=np.uint16)
    body = encode_replies(values[None])[0].tobytes()
    stream = reply_frame(65_537, 2**32 + 5, values, body) + serials_frame(3, 7, ['BT-1', '', 'BT-3'])
    reply, serials = FrameDecoder().feed(stream)
    assert (reply.kind, reply.sequence, reply.time_us, reply.rows, reply.columns, reply.body) == (
        ord('B'), 1, 5, 44, 3, body,
    )  # fmt: skip
    assert (serials.kind, serials.body) == (ord('S'), b'BT-1,,BT-3')
