# SPDX-License-Identifier: Apache-2.0
from types import SimpleNamespace

import pytest

from texture_core.errors import DeviceError
from texture_drivers.serial_line import resolve, serial_number
from texture_drivers.tsf85 import USB_IDS

NEW = SimpleNamespace(device='/dev/ttyACM0', vid=0x16D0, pid=0x14CC, serial_number='A7')
OLD = SimpleNamespace(device='/dev/ttyACM3', vid=0x04B4, pid=0xF232, serial_number=None)
OTHER = SimpleNamespace(device='/dev/ttyUSB0', vid=0x0403, pid=0x6001, serial_number='FT')
BOARD = SimpleNamespace(device='/dev/ttyS0', vid=None, pid=None, serial_number=None)


@pytest.mark.parametrize('wanted', [NEW, OLD])
def test_the_only_one_is_found_by_its_numbers(wanted):
    assert resolve('auto', USB_IDS, 'TSF-85', lambda: [BOARD, OTHER, wanted]) == wanted.device


def test_a_path_is_taken_as_it_is():
    assert resolve('/dev/mine', USB_IDS, 'TSF-85', lambda: []) == '/dev/mine'


def test_when_there_is_none_the_ports_are_listed():
    with pytest.raises(DeviceError, match=r'no TSF-85 \(16D0:14CC or 04B4:F232\).* none; plug it in'):
        resolve('auto', USB_IDS, 'TSF-85', lambda: [])
    with pytest.raises(DeviceError, match=r'are /dev/ttyS0, /dev/ttyUSB0 \(0403:6001\); plug it in'):
        resolve('auto', USB_IDS, 'TSF-85', lambda: [OTHER, BOARD])


def test_among_several_one_must_be_chosen():
    with pytest.raises(DeviceError, match=r'any of 2 TSF-85s: /dev/ttyACM0, /dev/ttyACM3; set the parameter device'):
        resolve('auto', USB_IDS, 'TSF-85', lambda: [OLD, NEW])


def test_the_serial_number_is_that_of_the_port_behind_a_link(tmp_path):
    port = SimpleNamespace(device=str(tmp_path / 'ttyACM0'), vid=1, pid=1, serial_number='A7')
    (tmp_path / 'ttyACM0').touch()
    (tmp_path / 'link').symlink_to(port.device)
    assert serial_number(str(tmp_path / 'link'), lambda: [BOARD, port]) == 'A7'
    assert serial_number('/dev/nothing', lambda: [BOARD, port]) == ''
