"""A sound card without hardware: ALSA's file plugin reads what is sampled from a pipe, PortAudio lists it as a card.

It lives in user space: the environment variable `ALSA_CONFIG_PATH` names its configuration, in the process that opens
it and before PortAudio is loaded there.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# A write of this many bytes is read at once, or not at all; PortAudio asks for two blocks of 480 frames.
FRAMES_AT_ONCE = 960
SYSTEM_CONFIG = '/usr/share/alsa/alsa.conf'
CONFIG = """pcm.{name} {{
  type file
  slave.pcm null
  file /dev/null
  infile "{pipe}"
  format raw
  hint {{ show on description "emulated sound card" }}
}}
"""


class EmulatedSoundCard:
    """A card that delivers, in its own time, what it is given.

    Parameters
    ----------
    folder
        Where its configuration and its pipe are made; must exist.
    name
        By which PortAudio knows it.
    """

    def __init__(self, folder: Path, name: str = 'emulated') -> None:
        self.name = name
        self.dropped_frames = 0  # nobody took them
        pipe, config = folder / f'{name}.pipe', folder / f'{name}.conf'
        os.mkfifo(pipe)
        config.write_text(CONFIG.format(name=name, pipe=pipe))
        self.environment = {'ALSA_CONFIG_PATH': f'{SYSTEM_CONFIG}:{config}'}
        # Both ends are open here: listing the cards opens and closes the pipe, too, and must not end it.
        self._pipe = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)

    def sample(self, counts: NDArray[np.int16]) -> None:
        """Deliver 960 samples of the only channel.

        Parameters
        ----------
        counts : (960,)
            Samples; what nobody takes is dropped and counted.

        Raises
        ------
        ValueError
            If there are more or fewer.
        """
        if counts.shape != (FRAMES_AT_ONCE,):
            raise ValueError(f'the samples have the shape {counts.shape}; ({FRAMES_AT_ONCE},) is delivered at once')
        try:
            os.write(self._pipe, counts.astype('<i2').tobytes())
        except BlockingIOError:
            self.dropped_frames += FRAMES_AT_ONCE

    def drain(self) -> None:
        """Throw away what nobody has taken, as a card does that is not open."""
        try:
            while os.read(self._pipe, 65536):
                pass
        except BlockingIOError:
            return

    def close(self) -> None:
        """Close the pipe; who reads it gets nothing any more."""
        os.close(self._pipe)
