"""The node of every sensor: reads it in a thread and publishes its batches."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from texture_msgs import msg

from texture_core.catalogue import find
from texture_core.errors import TextureError
from texture_core.parameters import param
from texture_core.protocols import Sensor
from texture_core.ros.conversions import to_msg
from texture_core.ros.diagnostics import Diagnostics
from texture_core.ros.parameters import declare, read
from texture_core.ros.qos import SENSOR_QOS
from texture_core.ros.run import run
from texture_core.signal import TactileSignal
from texture_drivers.catalogue import SENSORS
from texture_drivers.params import SensorParams
from texture_drivers.sensor_health import SensorHealth
from texture_drivers.sensor_reader import SensorReader


@dataclass(frozen=True)
class SensorNodeParams(SensorParams):
    """Parameters of the sensor node."""

    sensor: str = param(
        'tsf85', "Sets the sensor that is read: a name of the catalogue, or 'module:Class' of your own."
    )
    autostart: bool = param(
        True, 'Configures and activates the node at start-up, so that no lifecycle manager is needed.'
    )


class SensorNode(LifecycleNode):
    """Publish the batches of one tactile sensor, and survive its being unplugged."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('sensor', **kwargs)
        params = declare(self, SensorNodeParams)
        self._make(params)  # what is wrong in the parameters ends the node here, with a sentence
        self._reader: SensorReader | None = None
        self._topics: dict[str, Any] = {}
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
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start reading; a sensor that is not there yet is waited for."""
        result = super().on_activate(state)
        log = self.get_logger()
        self._reader = SensorReader(self._sensor, self._publish, log.warning, log.info)
        self._health = SensorHealth(self._reader, time.monotonic())
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
        return find(SENSORS, params.sensor, 'sensor')(params, lambda: self.get_clock().now().nanoseconds)

    def _destroy_publishers(self) -> None:
        for publisher in self._topics.values():
            self.destroy_publisher(publisher)
        self._topics = {}

    def _publish(self, topic: str, batch: TactileSignal) -> None:
        self._topics[topic].publish(to_msg(batch))

    def _report(self) -> tuple[str, str, dict[str, Any]]:
        if self._reader is None:
            return 'WARN', 'the sensor is not active', {}
        self._diagnostics.hardware_id = self._health.details.get('serial number', self._device)
        return self._health.report(time.monotonic())


def main() -> None:
    """Run the node."""
    run(SensorNode)
