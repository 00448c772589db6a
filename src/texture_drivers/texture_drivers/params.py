"""What every sensor needs to be told."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class SensorParams:
    """Where the sensor is and how its samples are delivered."""

    device: str = param('/dev/rq_tsf85_0', 'Path of the device; a symbolic link is followed at each opening.')
    config: str = param(
        '', "Settings of the sensor: path of a YAML file, or name of one in config/sensors; '' is the sensor's own."
    )
    frame_id: str = param('fingertip', 'Frame of the fingertip, for the headers.')
    batch_s: float = param(0.01, 'Length of one batch of samples.', unit='s', low=0.001, high=0.1)
    finger: int = param(0, 'Which finger of the device is read.', low=0, high=1)
    static_rate_hz: float = param(60.0, 'Rate at which the taxel image is published.', unit='Hz', low=1.0, high=1000.0)
