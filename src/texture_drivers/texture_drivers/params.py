"""Parameters of every sensor."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class SensorParams:
    """Where the sensor is and how its samples are delivered."""

    device: str = param(
        '/dev/rq_tsf85_0',
        "Sets the path of the device; a symbolic link is followed at each opening. 'auto' finds the only "
        'TSF-85 on USB.',
    )
    config: str = param(
        '',
        "Sets the settings of the sensor: path of a YAML file or name of one in config/sensors; '' takes the defaults.",
    )
    frame_id: str = param(
        'fingertip',
        'Sets the frame of the fingertip in the published messages; in a namespace NAMESPACE/ is put before it.',
    )
    batch_s: float = param(
        0.01,
        'Sets the duration of one published batch; a longer batch costs less computing time and adds latency.',
        unit='s',
        low=0.001,
        high=0.1,
    )
    finger: int = param(
        0, 'Sets the index of the finger that is read; 0 is the first one of the device.', low=0, high=4
    )
    static_rate_hz: float = param(
        0.0,
        'Sets the rate at which taxel images are published; 0 takes the default of the sensor.',
        unit='Hz',
        low=0.0,
        high=1000.0,
    )
