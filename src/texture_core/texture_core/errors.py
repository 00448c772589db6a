# SPDX-License-Identifier: Apache-2.0
"""What can go wrong, each with one sentence for the user: what came, what is allowed, what to do."""

from __future__ import annotations

MAX_CHARACTERS = 1000


class TextureError(Exception):
    """Base of all errors that a user can cause or meet; its text, always one line, is shown to the user as it is."""

    def __init__(self, sentence: str = '') -> None:
        line = ' '.join(sentence.split())  # what came, and what others said about it, may be many lines or long ones
        super().__init__(line if len(line) <= MAX_CHARACTERS else f'{line[: MAX_CHARACTERS - 1]}…')


class UnknownName(TextureError):
    """A name that no catalogue knows."""


class InvalidParameter(TextureError):
    """A parameter of the wrong type or out of its range."""


class InvalidData(TextureError):
    """Samples, windows or recordings that cannot be used."""


class ModelMismatch(TextureError):
    """A model that does not fit the data, the recipe or the features it is given."""


class DeviceError(TextureError):
    """A device that cannot be reached or does not answer."""


class CommandRefused(DeviceError):
    """A command that an arm or a hand does not carry out: not finite, too fast, or too hard."""


class MotionRefused(TextureError):
    """A motion that is unknown, unsafe or impossible now."""


class MotionAborted(TextureError):
    """A motion that had begun and was ended early."""


class InvalidLaunch(TextureError):
    """A launch file or launch argument that cannot be used."""


class MissingLibrary(TextureError):
    """A Python library of an extra, which the suite does without, and which is not installed."""

    def __init__(self, name: str, purpose: str, extra: str) -> None:
        super().__init__(
            f"{purpose} need the library '{name}', which is not installed; run 'pip install {name}', which the extra "
            f"'{extra}' names"
        )


class LaunchFailed(TextureError):
    """A node that died, or did not come up in time."""
