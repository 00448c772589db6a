"""The parameters of the emulated rig."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param
from texture_simulation.live_catalogue import LIVE_SENSORS


@dataclass(frozen=True)
class EmulatorParams:
    """What is emulated and where it is reached."""

    scene: str = param(
        'twelve_textures', 'Sets the scene that is emulated: the name of a shipped one or the path of a scene file.'
    )
    surface: str = param('glass', 'Sets the surface under the finger; setting it at run time swaps the sample.')
    seed: int = param(0, 'Sets the seed of all randomness; equal seeds give equal signals.', low=0)
    sensor: str = param(
        '',
        "Sets the emulated sensor, which appears at `sensor_link`; '' takes that of the scene.",
        choices=('', *LIVE_SENSORS),
    )
    sensor_link: str = param(
        '/tmp/texture/tsf85',
        'Sets the path of the symbolic link to the emulated sensor, which is the device path of the sensor node.',
    )
    finger: int = param(0, 'Sets the index of the finger of a TSF-85 that touches the surface.', low=0, high=1)
    long_stamps: bool = param(
        True,
        'Lets the TSF-85 send 64-bit stamps as firmware from 1.1.7 on does; false sends the 16-bit stamps '
        'of older firmware.',
    )
    daq_link: str = param(
        '', "Sets the path of the link to a data acquisition finger beside the sensor; '' leaves it out."
    )
    pvdf_link: str = param('', "Sets the path of the link to a PVDF finger beside the sensor; '' leaves it out.")
    plugged: bool = param(True, 'Plugs the emulated sensor in; setting it to false at run time unplugs it.')
    unplugged_finger: int = param(
        -1,
        'Sets the finger of a TSF-85 whose plug is out of the hub, which may be set at run time; -1 is none.',
        low=-1,
        high=1,
    )
    bit_flips: float = param(
        0.0,
        'Sets the probability that one bit of a byte of the sensor flips on the line; it may be set at run time.',
        low=0.0,
        high=1.0,
    )
    finger_port: int = param(
        28500,
        'Sets the UDP port on loopback at which finger states are received; 0 takes any free port.',
        low=0,
        high=65535,
    )
