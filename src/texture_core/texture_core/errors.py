# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Errors, each with one sentence for the user: the value, what is allowed, what to do."""

from __future__ import annotations

import enum
import re

MAX_CHARACTERS = 1000
# What Python adds to the text of the operating system: a number, and the path, which messages already name.
ERRNO = re.compile(r"\[Errno -?\d+\] ([^:'\"]*)(: '[^']*')?")


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, such as '1 slide' or '2 slides'."""
    return f'{number} {noun}{"s" * (number != 1)}'


class TextureError(Exception):
    """Base of all errors that a user can cause or meet; its text, always one line, is shown to the user unchanged."""

    def __init__(self, sentence: str = '', field: str = '') -> None:
        # A rejected value, or the error of a library, may have many or long lines.
        line = ' '.join(ERRNO.sub(r'\1', sentence).split())
        super().__init__(line if len(line) <= MAX_CHARACTERS else f'{line[: MAX_CHARACTERS - 1]}…')
        self.field = field  # of the request that is invalid, if it is one field


class UnknownName(TextureError):
    """A name that is in no catalogue."""


class InvalidParameter(TextureError):
    """A parameter of the wrong type or out of its range."""


class InvalidData(TextureError):
    """Samples, windows or recordings that cannot be used."""


class ModelMismatch(TextureError):
    """A model that does not fit the data, the recipe or the features it is given."""


class DeviceError(TextureError):
    """A device that cannot be reached or does not answer."""


class CommandRefused(DeviceError):
    """A command that an arm or a hand refuses: not finite, too fast, or too much force."""


class ExplorationError(enum.IntEnum):
    """Why an exploration is no success: `error_code` of the message ExplorationResult, which describes each value.

    From 10 on it was refused and nothing has moved; from 20 on it was aborted, with NO_SIGNAL also before it moved.
    """

    NONE = 0
    INTERNAL = 1
    UNKNOWN_MOTION = 10
    INVALID_REQUEST = 11
    BUSY = 12
    NOT_ACTIVE = 13
    ARM_NOT_READY = 14
    UNUSED_FIELD = 15
    OUTSIDE_WORKSPACE = 16
    STOPPED = 20
    CANCELLED = 21
    TIMEOUT = 22
    NO_SURFACE = 23
    MOTION_FAILED = 24
    FORCE_LIMIT = 25
    FORCE_SENSOR = 26
    WORKSPACE = 27
    ARM_FAULT = 28
    NO_SIGNAL = 29
    NO_SAMPLES = 30


class CollectionError(enum.IntEnum):
    """Why a collection is no success."""

    NONE = 0
    STOPPED = 20
    CANCELLED = 21
    MOTION_FAILED = 24
    NOT_RECORDED = 31
    BOUND_MISSED = 32


class MotionRefused(TextureError):
    """A motion that is unknown, unsafe or impossible now."""

    def __init__(
        self, sentence: str = '', error: ExplorationError = ExplorationError.INVALID_REQUEST, field: str = ''
    ) -> None:
        super().__init__(sentence, field)
        self.error = error


class MotionAborted(TextureError):
    """A motion that had begun and was ended early."""

    def __init__(self, sentence: str = '', error: ExplorationError = ExplorationError.MOTION_FAILED) -> None:
        super().__init__(sentence)
        self.error = error


class InvalidLaunch(TextureError):
    """A launch file or launch argument that cannot be used."""


class MissingLibrary(TextureError):
    """A Python library of an extra, which the suite does without, and which is not installed."""

    def __init__(self, name: str, purpose: str, extra: str) -> None:
        super().__init__(
            f"{purpose} need the library '{name}', which is not installed; run 'pip install {name}', which the extra "
            f"'{extra}' names"
        )

    def __reduce__(self) -> tuple[type[TextureError], tuple[str]]:
        return TextureError, (str(self),)  # from another process


class LaunchFailed(TextureError):
    """A node that died, or did not come up in time."""
