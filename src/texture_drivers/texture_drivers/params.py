"""What every sensor needs to be told."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class SensorParams:
    """Where the sensor is and how its samples are delivered."""

    device: str = param(
        '/dev/rq_tsf85_0', "Path of the device; a link is followed at each opening. 'auto': the only TSF-85 on USB."
    )
    config: str = param(
        '', "Settings of the sensor: path of a YAML file, or name of one in config/sensors; '' is the sensor's own."
    )
    frame_id: str = param('fingertip', 'Frame of the fingertip, for the headers.')
    batch_s: float = param(0.01, 'Length of one batch of samples.', unit='s', low=0.001, high=0.1)
    finger: int = param(0, 'Which finger of the device is read; 0 is the first.', low=0, high=4)
    static_rate_hz: float = param(
        0.0, "Rate at which the taxel image is published; 0: the sensor's own.", unit='Hz', low=0.0, high=1000.0
    )
