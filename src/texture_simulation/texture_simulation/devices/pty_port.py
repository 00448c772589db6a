"""A serial device made of a pseudo-terminal, behind a symbolic link, that can be unplugged."""

from __future__ import annotations

import contextlib
import os
import tty
from pathlib import Path

from texture_core.errors import DeviceError


class PtyPort:
    """The device's end of a pseudo-terminal; `link` leads to the other end, whatever its name is this time.

    Writing never waits: what does not fit the kernel's buffer (about 14 kB) is dropped and counted, as a device does
    when nobody reads it.
    """

    def __init__(self, link: Path) -> None:
        self.link = link
        self.dropped_bytes = 0
        self._ends: tuple[int, int] | None = None

    @property
    def plugged(self) -> bool:
        """Whether the device is there."""
        return self._ends is not None

    def plug(self) -> None:
        """Make the device appear under a new name, and lead the link there.

        Raises
        ------
        DeviceError
            If the link cannot be made.
        """
        if self._ends is not None:
            return
        device_end, host_end = os.openpty()
        tty.setraw(host_end)
        os.set_blocking(device_end, False)
        self._ends = (device_end, host_end)  # the host end stays open here, or reading fails while no driver is there
        try:
            _point_link(self.link, os.ttyname(host_end))
        except OSError as error:
            self.unplug()
            raise DeviceError(
                f"the link '{self.link}' to the emulated device cannot be made: {error}; choose a path in a folder "
                'that you may write to, where no other file stands'
            ) from error

    def unplug(self) -> None:
        """Make the device vanish, link and all; whoever has it open gets an error."""
        if self._ends is None:
            return
        name = os.ttyname(self._ends[1])
        for end in self._ends:
            os.close(end)
        self._ends = None
        with contextlib.suppress(OSError):
            if self.link.readlink() == Path(name):
                self.link.unlink()

    def read(self) -> bytes:
        """Return what the host has sent."""
        if self._ends is None:
            return b''
        try:
            return os.read(self._ends[0], 4096)
        except BlockingIOError:
            return b''

    def write(self, data: bytes) -> None:
        """Send what fits."""
        if self._ends is None or not data:
            return
        try:
            sent = os.write(self._ends[0], data)
        except BlockingIOError:
            sent = 0
        self.dropped_bytes += len(data) - sent


def _point_link(link: Path, target: str) -> None:
    """Make or change a symbolic link at once, so that it is never missing; a file that is no link is left alone."""
    link.parent.mkdir(parents=True, exist_ok=True)
    if link.exists() and not link.is_symlink():
        raise FileExistsError(f'there is a file that is no link at {link}')
    passing = link.with_name(f'{link.name}.{os.getpid()}')
    passing.symlink_to(target)
    passing.replace(link)
