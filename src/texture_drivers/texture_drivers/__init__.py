# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drivers of tactile sensors, from bytes to `TactileSignal`; the node `sensor` runs any of them.

Data in: the bytes of a device. Data out: `signal` and `signal_static`, fast and slow channels in
the unit of the sensor, in batches of 5 to 20 ms; every lost sample is counted.

.. code-block:: python

    from texture_drivers.sensor import SensorParams
    from texture_drivers.tsf85 import Tsf85

    sensor = Tsf85(SensorParams(device='auto'))
    sensor.open()
    batches = sensor.read()  # {'signal': [TactileSignal, ...], 'signal_static': [...]}

With ROS: `ros2 run texture_drivers sensor --ros-args -p sensor:=tsf85 -p device:=auto`

Limits: nothing here has run on real hardware yet. Wiring and protocols: `docs/sensors.md`.
"""
