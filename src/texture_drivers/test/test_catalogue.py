# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every sensor of the catalogue must do."""

import time
from pathlib import Path

import pytest

from texture_core.config import find
from texture_core.errors import DeviceError, UnknownName
from texture_core.types import Sensor
from texture_drivers.catalogue import SENSORS
from texture_drivers.sensor import SensorParams


@pytest.fixture(params=SENSORS)
def sensor(request: pytest.FixtureRequest, tmp_path: Path) -> Sensor:
    return SENSORS[request.param](SensorParams(device=str(tmp_path / 'missing')), time.time_ns)


def test_a_missing_device_is_a_device_error_that_names_it(sensor: Sensor, tmp_path: Path) -> None:
    for _ in range(2):
        with pytest.raises(DeviceError, match=str(tmp_path / 'missing')):
            sensor.open()


def test_reading_before_opening_is_a_device_error(sensor: Sensor) -> None:
    with pytest.raises(DeviceError):
        sensor.read()


def test_closing_never_fails(sensor: Sensor) -> None:
    sensor.close()
    sensor.close()


def test_counts_and_rates_are_known_from_the_start(sensor: Sensor) -> None:
    assert {'samples', 'lost', 'reopened'} <= set(sensor.counts)
    assert not any(sensor.counts.values())
    assert any(topic.endswith('signal') for topic in sensor.expected_rates_hz)
    assert all(rate > 0 for rate in sensor.expected_rates_hz.values())


def test_a_mistyped_name_gets_the_nearest_one() -> None:
    with pytest.raises(UnknownName, match="did you mean 'tsf85'"):
        find(SENSORS, 'tsf58', 'sensor')
