# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node of every sensor: reads it in a thread and publishes its batches."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger
from texture_msgs import msg

from texture_core.config import param
from texture_core.errors import TextureError
from texture_core.ros import (
    SENSOR_QOS,
    STATE_QOS,
    Diagnostics,
    PatientLifecycleNode,
    WaitingExecutor,
    declare,
    frame_name,
    read,
    run,
    to_msg,
    to_stamp,
)
from texture_core.types import NANOSECONDS, Phase, Sensor, TactileSignal
from texture_drivers.catalogue import make_sensor
from texture_drivers.health import ChannelWatch, SensorHealth, TareParams
from texture_drivers.sensor import SensorParams, SensorReader

TARE_POLL_S, TARE_LATE_S = 0.02, 5.0  # how often a tare is looked at, and how much longer its samples may take

# A signal of this name is published as sensor_msgs/Imu too, on imu/data_raw as REP-145 has it, while anyone listens.
IMU_SIGNAL = 'signal_imu'

# Phases of an exploration in which nothing touches the finger; after an abort it may still.
UNLOADED = frozenset(
    {msg.ExplorationState.PHASE_IDLE, msg.ExplorationState.PHASE_APPROACH, msg.ExplorationState.PHASE_DONE}
)


@dataclass(frozen=True)
class SensorNodeParams(TareParams, SensorParams):
    """Parameters of the sensor node."""

    sensor: str = param('tsf85', "Sensor that is read: a name of the catalogue, or the 'module:Class' of a custom one.")
    autostart: bool = param(
        True, 'Configures and activates the node at start-up, so that no lifecycle manager is needed.'
    )


class SensorNode(PatientLifecycleNode):
    """Publish the batches of one tactile sensor, and survive its being unplugged."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('sensor', **kwargs)
        params = declare(self, SensorNodeParams)
        self._make(params)  # what is wrong in the parameters ends the node here, with a sentence
        self._reader: SensorReader | None = None
        self._topics: dict[str, Any] = {}
        self._baselines: dict[str, Any] = {}
        self._imus: dict[str, Any] = {}
        self._busy = ''  # why nothing can be tared now
        self.create_service(Trigger, '~/tare', self._on_tare, callback_group=ReentrantCallbackGroup())
        self.create_subscription(msg.ExplorationState, 'exploration', self._on_exploration, STATE_QOS)
        self._diagnostics = Diagnostics(self, self._report, hardware_id=params.device)
        if params.autostart:
            self.trigger_configure()
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make the sensor and its publishers; nothing is opened."""
        try:
            params = read(self, SensorNodeParams)
            sensor = self._make(params)
        except TextureError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self._sensor = sensor
        self._device = self._diagnostics.hardware_id = params.device
        self._topics = {
            topic: self.create_lifecycle_publisher(msg.TactileSignal, topic, SENSOR_QOS)
            for topic in sensor.expected_rates_hz
        }
        self._baselines = {
            topic: self.create_publisher(msg.TactileSignal, f'{topic}_baseline', STATE_QOS) for topic in self._topics
        }
        self._imus = {
            topic: self.create_publisher(Imu, f'{topic.removesuffix(IMU_SIGNAL)}imu/data_raw', SENSOR_QOS)
            for topic in self._topics
            if topic.endswith(IMU_SIGNAL)
        }
        self._tare_s = params.tare_s
        self._watch = ChannelWatch(params, list(self._topics), getattr(sensor, 'limits', {}))
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start reading; a sensor that is not there yet is waited for."""
        result = super().on_activate(state)
        log = self.get_logger()
        self._reader = SensorReader(self._sensor, self._publish, log.warning, log.info)
        self._health = SensorHealth(self._reader, time.monotonic(), self._watch)
        self._reader.start()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop reading and close the sensor."""
        self.shutdown()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the sensor."""
        self._destroy_publishers()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop whatever runs."""
        self.shutdown()
        self._destroy_publishers()
        return super().on_shutdown(state)

    def shutdown(self) -> None:
        """Join the reader thread; the sensor is closed then."""
        if self._reader is not None:
            self._reader.stop()
            self._reader = None

    def _make(self, params: SensorNodeParams) -> Sensor:
        return make_sensor(params, lambda: self.get_clock().now().nanoseconds)

    def _destroy_publishers(self) -> None:
        for publisher in (*self._topics.values(), *self._baselines.values(), *self._imus.values()):
            self.destroy_publisher(publisher)
        self._topics, self._baselines, self._imus = {}, {}, {}

    def _publish(self, topic: str, batch: TactileSignal) -> None:
        published, baseline = self._watch.add(topic, batch)
        message = self._message(topic, published)
        self._topics[topic].publish(message)
        if topic in self._imus and self._imus[topic].get_subscription_count():
            for imu in imu_messages(message, published):
                self._imus[topic].publish(imu)
        if baseline is not None:
            self._baselines[topic].publish(self._message(topic, baseline.as_signal()))
            self.get_logger().info(f"'{topic}' is tared")

    def _message(self, topic: str, signal: TactileSignal) -> msg.TactileSignal:
        """Return the message of a signal, in the frame of its fingertip as tf names it: 'left/finger0/fingertip'."""
        message = to_msg(signal)
        finger = f'{self.get_namespace()}/{topic.rpartition("/")[0]}'
        message.header.frame_id = frame_name(finger, signal.frame_id)
        return message

    def _on_tare(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Tare, and answer when that is done or refused; called in a separate thread."""
        watch, reader = self._watch, self._reader
        if reader is None or reader.fault:
            cause = 'the sensor delivers no samples; see its message on /diagnostics'
            response.message = cause if reader else 'the sensor node is not active; activate it'
            return response
        if self._busy:
            response.message = f'nothing is tared: {self._busy}'
            return response
        before = watch.baselines
        watch.start_tare()
        end_s = time.monotonic() + self._tare_s + TARE_LATE_S
        while time.monotonic() < end_s and watch.taring:
            time.sleep(TARE_POLL_S)
        missing = [topic for topic, baseline in watch.baselines.items() if baseline is before[topic]]
        response.success = not missing
        tared = ', '.join(topic for topic in before if topic not in missing)
        response.message = f'{tared} tared' if tared else 'nothing is tared'
        if missing:
            cause = watch.refusal or 'too few samples came, or the finger touched something'
            response.message += f'; {" and ".join(missing)} not: {cause}'
        return response

    def _on_exploration(self, state: msg.ExplorationState) -> None:
        phase = next((one for one in Phase if one.code == state.phase), None)
        if state.lifted or phase is Phase.DONE:
            self._busy = ''
        elif phase is not Phase.IDLE:  # an idle finger is where the exploration before left it
            self._busy = (
                f"the finger may touch something, after the phase '{phase.value if phase else state.phase}' of an "
                'exploration; tare when it has ended, or lift the finger first'
            )
        if self._reader is not None:
            self._watch.unloaded = state.phase in UNLOADED
            if self._busy:
                self._watch.end_tare(self._busy)

    def _report(self) -> tuple[str, str, dict[str, Any]]:
        if self._reader is None:
            return 'WARN', 'the sensor is not active', {}
        self._diagnostics.hardware_id = self._health.details.get('serial number', self._device)
        level, sentence, numbers = self._health.report(time.monotonic())
        shared = '' if level == 'ERROR' else shared_topic(self, self._topics.values())
        return ('WARN', shared, numbers) if shared else (level, sentence, numbers)


def shared_topic(node: Node, publishers: Iterable[Any]) -> str:
    """Return a warning of a topic that another node publishes too, '' if there is none."""
    taken = [one.topic_name for one in publishers if node.count_publishers(one.topic_name) > 1]
    return f"another node publishes on '{taken[0]}' too, and the samples of both are mixed; end it" if taken else ''


def imu_messages(message: msg.TactileSignal, signal: TactileSignal) -> Iterator[Imu]:
    """Yield a sensor_msgs/Imu for each sample of an inertial unit: no orientation, covariances unknown (REP-145)."""
    for number, row in enumerate(signal.samples[:, :6].tolist()):
        imu = Imu()
        imu.header.frame_id = message.header.frame_id
        imu.header.stamp = to_stamp(signal.stamp_ns + round(number / signal.sampling_rate_hz * NANOSECONDS))
        imu.orientation_covariance[0] = -1.0
        imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z = row[:3]
        imu.angular_velocity.x, imu.angular_velocity.y, imu.angular_velocity.z = row[3:]
        yield imu


def main() -> None:
    """Run the node."""
    run(SensorNode, make_executor=WaitingExecutor)
