"""Settings of the TSF-85 beside those of every sensor: its inertial sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_drivers.tsf85 import tables

STANDARD_GRAVITY_M_S2 = 9.80665
TESLA_PER_UT = 1e-6
AXES = 'xyz'


@dataclass(frozen=True)
class Tsf85Settings:
    """Whether and how the inertial sensors of the finger are published, as topic 'imu'."""

    imu: bool = param(True, "Publishes acceleration and angular rate on the topic 'imu'.")
    magnetometer: bool = param(False, 'Publishes the magnetic field too, which only few firmware versions send.')
    # Of the vendor's viewer: 2 g and 250 degrees a second are full scale.
    acceleration_count_g: float = param(
        16384.0,
        'Sets the accelerometer counts of one g; a larger value gives smaller accelerations.',
        unit='1/g',
        low=1.0,
        high=1e6,
    )
    rotation_count_dps: float = param(
        131.072,
        'Sets the gyroscope counts of one degree per second; a larger value gives smaller angular rates.',
        unit='s/deg',
        low=1e-3,
        high=1e6,
    )
    # Data sheet of the ICM-20948: 0.15 microtesla a count.
    field_count_ut: float = param(
        1 / 0.15,
        'Sets the magnetometer counts of one microtesla; a larger value gives smaller fields.',
        unit='1/µT',
        low=1e-3,
        high=1e6,
    )

    @property
    def kinds(self) -> tuple[int, ...]:
        """Kinds of items that are published, three numbers each."""
        wanted = {tables.ACCELEROMETER: self.imu, tables.GYROSCOPE: self.imu, tables.MAGNETOMETER: self.magnetometer}
        return tuple(kind for kind, is_wanted in wanted.items() if is_wanted)

    @property
    def channels(self) -> tuple[str, ...]:
        """Name of each column."""
        return tuple(f'{QUANTITIES[kind][0]}_{axis}' for kind in self.kinds for axis in AXES)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each column."""
        return tuple(QUANTITIES[kind][1] for kind in self.kinds for _ in AXES)

    @property
    def gains(self) -> Array:
        """Unit per count of each column, (n_columns,)."""
        gains = {
            tables.ACCELEROMETER: STANDARD_GRAVITY_M_S2 / self.acceleration_count_g,
            tables.GYROSCOPE: math.radians(1.0) / self.rotation_count_dps,
            tables.MAGNETOMETER: TESLA_PER_UT / self.field_count_ut,
        }
        return np.repeat([gains[kind] for kind in self.kinds], len(AXES))


QUANTITIES = {
    tables.ACCELEROMETER: ('acceleration', 'm/s²'),
    tables.GYROSCOPE: ('rotation', 'rad/s'),
    tables.MAGNETOMETER: ('field', 'T'),
}
