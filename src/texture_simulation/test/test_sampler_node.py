"""The generic sensor node with the DAQ finger, the PVDF finger and a recording: real node, real topics."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from texture_msgs import msg

from texture_core.ros.local_graph import LocalGraph
from texture_core.ros.qos import SENSOR_QOS
from texture_drivers.nodes.sensor import SensorNode
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.pvdf import EmulatedPvdf

pytestmark = pytest.mark.ros
TOPICS = ('signal', 'signal_static')


class Bench:
    """An emulated device whose time passes."""

    def __init__(self, feel: Callable[[int, int], None]) -> None:
        self._feel = feel
        self.lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        start_s, done_ms = time.monotonic(), 0
        while not self._stop.wait(0.005):
            due_ms = int(1000 * (time.monotonic() - start_s))
            with self.lock:
                self._feel(done_ms, due_ms)
            done_ms = due_ms

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


class Ear:
    """The sensor node, and all that it publishes."""

    def __init__(self, graph: LocalGraph, **parameters: Any) -> None:
        self.messages = {topic: graph.listen(msg.TactileSignal, topic, SENSOR_QOS) for topic in TOPICS}
        self._reports = graph.listen(DiagnosticArray, '/diagnostics')
        graph.add(SensorNode, **parameters)
        self.until = graph.until

    @property
    def values(self) -> dict[str, str]:
        return {value.key: value.value for report in self._reports[-1:] for value in report.status[0].values}


@pytest.fixture
def start() -> Iterator[Callable[..., Ear]]:
    with LocalGraph(80) as graph:
        yield partial(Ear, graph)


def test_the_daq_finger_streams_and_survives_replugging(start: Callable[..., Ear], tmp_path: Path) -> None:
    device = EmulatedDaq(tmp_path / 'daq', np.random.default_rng(0))
    device.plug()
    bench = Bench(lambda a, b: device.feel(np.full(((b * 5) // 2 - (a * 5) // 2, 8), 1000, dtype=np.int16)))
    try:
        ear = start(sensor='daq', device=str(tmp_path / 'daq'), frame_id='tip')
        signal = ear.messages['signal']
        ear.until(lambda: len(signal) > 50)
        assert (signal[-1].sensor, signal[-1].unit, signal[-1].sampling_rate_hz) == ('daq', 'V', 2500.0)
        assert signal[-1].channels[::4] == ['pvdf_outer_1', 'strain_outer_1']
        assert set(signal[-1].samples) == {np.float32(1000 * 10 / 2**15)}
        before = signal[-1].first_sample
        with bench.lock:
            device.unplug()
            device.plug()
        signal.clear()
        ear.until(lambda: bool(signal) and ear.values.get('reopened') == '1')
        assert signal[-1].first_sample > before
    finally:
        bench.close()
        device.unplug()


def test_the_pvdf_finger_publishes_film_and_force(start: Callable[..., Ear], tmp_path: Path) -> None:
    device = EmulatedPvdf(tmp_path / 'pvdf', np.random.default_rng(0))
    device.plug()

    def feel(since_ms: int, until_ms: int) -> None:
        films, forces = (until_ms * rate // 1000 - since_ms * rate // 1000 for rate in (4096, 64))
        device.feel(np.full(films, 500, dtype=np.int16), np.full(forces, 300, dtype=np.int16))

    bench = Bench(feel)
    try:
        ear = start(sensor='pvdf', device=str(tmp_path / 'pvdf'))
        ear.until(lambda: len(ear.messages['signal']) > 20 and len(ear.messages['signal_static']) > 20)
        assert ear.messages['signal'][-1].samples[0] == pytest.approx(1.0)  # pC
        assert ear.messages['signal_static'][-1].samples[0] == pytest.approx(1.5)  # N
    finally:
        bench.close()
        device.unplug()


def test_a_recording_is_played_as_a_sensor(start: Callable[..., Ear], tmp_path: Path) -> None:
    np.savez(tmp_path / 'slide.npz', samples=np.arange(500.0)[:, None], rate_hz=1000.0, channels=['film'])
    ear = start(sensor='file', device=str(tmp_path / 'slide.npz'), config='{loop: true, unit: Pa}')
    signal = ear.messages['signal']
    ear.until(lambda: len(signal) > 60)
    assert (signal[-1].sensor, signal[-1].unit, signal[-1].channels) == ('file/slide', 'Pa', ['film'])
    assert all(message.samples[0] == message.first_sample % 500 for message in signal)
