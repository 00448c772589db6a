"""The BioTac driver on an emulated bridge: what the contract of all sensors does not ask."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_rig import Rig, biotac

from texture_core.types import lost_samples
from texture_drivers.biotac import LAYOUTS, BioTac
from texture_drivers.sensor import SensorParams
from texture_simulation.devices.fingers import BoardFaults, EmulatedBioTac, FrameFaults

pytestmark = pytest.mark.realtime

Make = Callable[..., Rig]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    with ExitStack() as rigs:

        def make(serials: tuple[str, ...] = ('BT-0',), prefix: str = '', finger: int = 0, **options: Any) -> Rig:
            link = tmp_path / 'biotac'
            device = EmulatedBioTac(link, np.random.default_rng(0), serials)
            rig = rigs.enter_context(Rig('biotac', link, case=biotac(prefix, fingers=len(serials)), device=device))
            rig.sensor = BioTac(SensorParams(device=str(link), finger=finger), **options)
            rig.sensor.open()
            return rig

        yield make


def test_words_damaged_on_the_board_are_nan_and_no_neighbour_moves(make: Make) -> None:
    rig = make(serials=('BT-0', 'BT-1', ''), finger=1)
    rig.set(board_faults=BoardFaults(flip=0.01))
    batches = rig.signal_s(1.4)
    values = np.concatenate([batch.samples[:, 0] for batch in batches])
    assert 0.005 < np.isnan(values).mean() < 0.05  # two bytes a word
    assert len(set(rig.offsets(batches))) == 1
    assert lost_samples(batches) == 0
    assert rig.sensor.counts['damaged_words'] > 0


def test_frames_sent_twice_are_counted(make: Make) -> None:
    rig = make()
    rig.set(frame_faults=FrameFaults(duplicate=0.1))
    rig.signal_s(1.0)
    assert rig.sensor.counts['repeated'] > 0


def test_a_reset_of_the_device_is_an_interruption(make: Make) -> None:
    rig = make()
    before = rig.signal_s(1.0)
    rig.run_locked(rig.device.reset)
    after = rig.signal_s(0.5)
    assert rig.sensor.counts['restarts'] == 1
    assert len(set(rig.offsets(after[1:]))) == 1
    elapsed_s = (after[-1].stamp_ns - before[0].stamp_ns) / 1e9
    assert (after[-1].first_sample - before[0].first_sample) / 2200 == pytest.approx(elapsed_s, abs=0.03)


def test_the_serial_number_is_reported_and_a_silent_bridge_is_an_error_with_advice(make: Make) -> None:
    rig = make()
    rig.signal_s(1.5)
    assert rig.sensor.details['serial of finger 0'] == 'BT-0'
    rig.set(silent=True)
    assert 'sends no whole frames' in rig.fault()


def test_the_wrong_kind_of_biotac_is_reported(make: Make) -> None:
    assert '44 slots' in make(layout=LAYOUTS['biotac_sp']).fault()


def test_all_fingers_of_a_board_have_topics_of_their_own(make: Make) -> None:
    rig = make(serials=('BT-0', 'BT-1', ''), prefix='finger1/', fingers=(0, 1, 2))
    topics = rig.read_s(0.1)
    assert not topics['finger2/signal']
    assert set(topics) == {f'finger{n}/{topic}' for n in range(3) for topic in ('signal', 'signal_static')}
