# SPDX-License-Identifier: Apache-2.0
import errno
import termios

import pytest
import serial

from texture_core.errors import DeviceError
from texture_drivers.serial_line import SerialPort, reason_of


def test_a_missing_device_is_named_once_with_the_reason_of_the_operating_system(tmp_path):
    path = str(tmp_path / 'missing')
    with pytest.raises(DeviceError) as refusal:
        SerialPort(path)
    assert str(refusal.value).startswith(
        f"device '{path}' cannot be used (No such file or directory); check that it is"
    )
    assert str(refusal.value).count(path) == 1


@pytest.mark.parametrize(
    ('error', 'reason'),
    [
        (PermissionError(errno.EACCES, 'Permission denied', '/dev/x'), 'Permission denied'),
        (termios.error(errno.EIO, 'Input/output error'), 'Input/output error'),
        (serial.SerialException('Write timeout'), 'Write timeout'),
    ],
)
def test_the_reason_of_a_fault_holds_no_path(error, reason):
    assert reason_of(error) == reason
