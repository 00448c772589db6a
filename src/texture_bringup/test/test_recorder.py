# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import pytest

from texture_bringup.dashboard import Recorder
from texture_core.errors import InvalidParameter


def test_what_cannot_be_recorded_is_reported_and_nothing_is_left_to_end(tmp_path):
    (tmp_path / 'file').touch()
    recorder = Recorder(tmp_path / 'file', '/')
    with pytest.raises(InvalidParameter, match='nothing can be recorded in'):
        recorder.begin('now')
    recorder.watch()
    assert (recorder.bag, recorder.end()) == ('', 'nothing is being recorded')
