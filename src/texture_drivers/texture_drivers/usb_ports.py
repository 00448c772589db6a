"""Find a serial device by the numbers that its maker was given for USB."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Protocol

from serial.tools import list_ports

from texture_core.errors import DeviceError

AUTO = 'auto'
UsbId = tuple[int, int]  # vendor, product


class Port(Protocol):
    """What pyserial knows of a port; all but `device` may be None."""

    device: str
    vid: int | None
    pid: int | None
    serial_number: str | None


ListPorts = Callable[[], Iterable[Port]]


def resolve(device: str, usb_ids: Sequence[UsbId], kind: str, ports: ListPorts = list_ports.comports) -> str:
    """Return the path that is meant: `device` itself, or for 'auto' that of the only port with one of the numbers.

    Parameters
    ----------
    device
        Path of the device, or 'auto'.
    usb_ids
        Vendor and product numbers of the device.
    kind
        Name of the device for the error sentence, such as 'TSF-85'.
    ports
        Lists the ports of this machine.

    Returns
    -------
    str
        Path of a port.

    Raises
    ------
    DeviceError
        If for 'auto' there is none or more than one.
    """
    if device != AUTO:
        return device
    listed = list(ports())
    found = sorted(port.device for port in listed if (port.vid, port.pid) in usb_ids)
    if len(found) == 1:
        return found[0]
    if found:
        raise DeviceError(
            f"device 'auto' may be any of {len(found)} {kind}s: {', '.join(found)}; set the parameter device to one"
        )
    seen = ', '.join(sorted(_description(port) for port in listed)) or 'none'
    wanted = ' or '.join(_numbers(*usb_id) for usb_id in usb_ids)
    raise DeviceError(
        f"device 'auto' is no {kind} ({wanted}): the serial ports here are {seen}; plug it in, or set the parameter "
        'device to its path'
    )


def serial_number(device: str, ports: ListPorts = list_ports.comports) -> str:
    """Return the serial number of the USB device behind a path, '' if it tells none."""
    path = str(Path(device).resolve())
    return next((port.serial_number or '' for port in ports() if port.device == path), '')


def _description(port: Port) -> str:
    if port.vid is None or port.pid is None:
        return port.device
    return f'{port.device} ({_numbers(port.vid, port.pid)})'


def _numbers(vendor: int, product: int) -> str:
    return f'{vendor:04X}:{product:04X}'
