# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Data types of all packages: signals, windows, features, estimates, explorations."""

from __future__ import annotations

import cmath
import contextlib
import enum
import fcntl
import hashlib
import math
import os
import select
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, Protocol, get_type_hints

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import DeviceError, InvalidData, counted

# --------------------
# Quality of service of every topic of the suite, in one place: for ROS, and for bags that are written without it.


class Quality(NamedTuple):
    """Number of messages kept, whether each must arrive, and whether late subscribers get them."""

    depth: int
    reliable: bool
    latched: bool


QUALITIES: Mapping[str, Quality] = {
    # One second of 5 ms batches: a stalled subscriber loses samples and never blocks the driver.
    'signal': Quality(200, reliable=False, latched=False),
    'signal_static': Quality(200, reliable=False, latched=False),
    # Few and small, none may be missing: they carry the end of an exploration.
    'features': Quality(200, reliable=True, latched=False),
    # A late subscriber gets the newest estimates, and so the result of the last exploration.
    'texture': Quality(50, reliable=True, latched=True),
    'roughness': Quality(50, reliable=True, latched=True),
    # The labels of the estimates, once for each change of the model.
    'model_info': Quality(1, reliable=True, latched=True),
    # What the explorer can do, once for each change.
    'explorer_info': Quality(1, reliable=True, latched=True),
    # A node that starts late gets the present state at once.
    'exploration': Quality(100, reliable=True, latched=True),
}

# --------------------
# Names for array types; the docstring of each function gives the shape.

Array = NDArray[np.float64]
Samples = NDArray[np.float64]  # (..., n_samples, n_channels)
AnyArray = NDArray[Any]


# --------------------
# What may be the label of a surface: it is shown, stored in file names and compared, so it is short and plain.

MAX_CHARACTERS = 100
# They separate folders, and the surface from the number of a slide.
FORBIDDEN = frozenset('/\\')
SHOWN_CHARACTERS = 40


def checked_label(label: str) -> str:
    """Return a label without the white space around it; '' stays ''."""
    label = label.strip()
    if len(label) > MAX_CHARACTERS:
        raise InvalidData(
            f"the label '{_shown(label)}' has {len(label)} characters; at most {MAX_CHARACTERS} are allowed"
        )
    if not label.isprintable() or FORBIDDEN.intersection(label):
        raise InvalidData(
            f"the label '{_shown(label)}' has a slash, a backslash or a character that cannot be printed; "
            'use letters, digits, spaces and punctuation'
        )
    return label


def needed_label(label: str) -> str:
    """Return a label as `checked_label` does; InvalidData if it is empty."""
    if label := checked_label(label):
        return label
    raise InvalidData('no surface was named; give its label')


def _shown(label: str) -> str:
    """Return the beginning of a label, safe to print."""
    start = label[:SHOWN_CHARACTERS].encode('unicode_escape').decode()
    return start + '…' * (len(label) > SHOWN_CHARACTERS)


# --------------------
# A batch of consecutive samples of one sensor.

NANOSECONDS = 1_000_000_000
MIN_HZ = 1e-3  # a sample in a quarter of an hour: below, stamps leave what 64 bits hold
MAX_HZ = 1e6  # seconds of samples are kept: an arbitrary rate could take all memory


@dataclass(frozen=True, eq=False)
class TactileSignal:
    """A batch of consecutive samples, as a driver delivers it and a message carries it.

    Parameters
    ----------
    stamp_ns
        Time of the first sample, ns since the epoch of the clock in use.
    sensor, channels
        Name of the sensor part, and of each column.
    units
        Unit of each channel, such as 'count' or 'Pa'; () if they are unknown.
    sampling_rate_hz
        Nominal rate, above 0 and at most 1 MHz.
    first_sample
        Running index of the first sample since the stream began; a jump between batches is a loss.
    samples : (n_samples, n_channels) float32
        NaN for a sample known to be bad.
    frame_id
        Frame of the fingertip.
    tared
        Whether the level without load is subtracted.

    Raises
    ------
    InvalidData
        If the shape, the rate or the index makes no sense.
    """

    stamp_ns: int
    sensor: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    sampling_rate_hz: float
    first_sample: int
    samples: NDArray[np.float32]
    frame_id: str = ''
    tared: bool = False

    def __post_init__(self) -> None:
        if self.samples.ndim != 2 or self.samples.shape[1] != len(self.channels):
            raise InvalidData(
                f"signal of '{self.sensor}' has samples of shape {self.samples.shape}; "
                f'(n_samples, {len(self.channels)}) is needed for its channels {list(self.channels)}'
            )
        if self.units and len(self.units) != len(self.channels):
            raise InvalidData(
                f"signal of '{self.sensor}' has {len(self.units)} units for {counted(len(self.channels), 'channel')}; "
                'give one for each, or none'
            )
        if not MIN_HZ <= self.sampling_rate_hz <= MAX_HZ:
            raise InvalidData(
                f"signal of '{self.sensor}' has a sampling rate of {self.sampling_rate_hz} Hz; "
                f'give one from {MIN_HZ:g} to {MAX_HZ:g}'
            )
        if self.first_sample < 0:
            raise InvalidData(f"signal of '{self.sensor}' starts at sample {self.first_sample}; 0 is the first")

    @property
    def common_unit(self) -> str:
        """Common unit of all channels; '' if they differ or are unknown."""
        return self.units[0] if len(set(self.units)) == 1 else ''

    @property
    def next_sample(self) -> int:
        """Running index of the sample after this batch."""
        return self.first_sample + len(self.samples)

    @property
    def end_ns(self) -> int:
        """Time of the sample after this batch, ns."""
        return self.stamp_ns + round(len(self.samples) / self.sampling_rate_hz * NANOSECONDS)


def lost_samples(batches: Sequence[TactileSignal]) -> int:
    """Return how many samples are missing between consecutive batches of one stream."""
    return sum(max(0, after.first_sample - before.next_sample) for before, after in pairwise(batches))


COMMON = ('sensor', 'channels', 'units', 'sampling_rate_hz', 'frame_id')  # of batches that can be joined


def join_batches(batches: Sequence[TactileSignal], anchors_ns: Iterable[int] = ()) -> list[TactileSignal]:
    """Return consecutive batches of one stream with those that continue one another joined: fewer and larger ones."""
    anchors = [next((n for n, batch in enumerate(batches) if batch.end_ns > time_ns), -1) for time_ns in anchors_ns]
    groups: list[list[TactileSignal]] = []
    for number, batch in enumerate(batches):
        last = groups[-1][-1] if groups else None
        alike = last and all(getattr(batch, name) == getattr(last, name) for name in COMMON)
        if last and alike and number not in anchors and batch.first_sample == last.next_sample:
            groups[-1].append(batch)
        else:
            groups.append([batch])
    return [replace(group[0], samples=np.concatenate([batch.samples for batch in group])) for group in groups]


# --------------------
# One window of a signal, from which features are computed.


@dataclass(frozen=True, eq=False)
class Window:
    """Samples of one stream over one stretch of sliding."""

    samples: Samples
    rate_hz: float
    channels: tuple[str, ...] = ()
    start_ns: int = 0
    speed_m_s: float = math.nan
    force_n: float = math.nan
    sensor: str = ''

    def __post_init__(self) -> None:
        if self.samples.ndim != 2 or 0 in self.samples.shape:
            raise InvalidData(f'a window has samples of shape {self.samples.shape}; (n_samples, n_channels) is needed')
        if not self.rate_hz > 0:
            raise InvalidData(f'a window has a sampling rate of {self.rate_hz} Hz; give one above 0')

    @property
    def duration_s(self) -> float:
        """Length of the window, s."""
        return len(self.samples) / self.rate_hz


# What sends samples that are numbered from 0 again.
RESTARTED = 'a driver or bridge (none if a replay went on to its next bag)'

# --------------------
# The features of one window of sliding.


@dataclass(frozen=True, eq=False)
class FeatureVector:
    """Named features of one window; the last of an exploration is empty and has `last` set.

    `feature_set` is the fingerprint of the windows, inputs and features that made the values: a model refuses
    vectors of another fingerprint. `skipped` counts the windows left out so far for lost or non-finite samples.
    `sequence` counts the vectors of the exploration that were sent before: a jump is a loss.
    `motion`, `direction_rad` and `sensor` describe the measurement of the window, as `speed_m_s` and `force_n` do.
    """

    start_ns: int
    exploration_id: str
    window_s: float
    hop_s: float
    names: tuple[str, ...] = ()
    values: Array = field(default_factory=lambda: np.empty(0))
    speed_m_s: float = math.nan
    force_n: float = math.nan
    feature_set: str = ''
    last: bool = False
    skipped: int = 0
    sequence: int = 0
    frame_id: str = ''
    motion: str = ''
    direction_rad: float = math.nan
    sensor: str = ''

    def __post_init__(self) -> None:
        if self.values.shape != (len(self.names),):
            raise InvalidData(f'a feature vector has {len(self.names)} names but values of shape {self.values.shape}')


# --------------------
# Estimates of texture and roughness.


class Rejection(enum.IntEnum):
    """Why a label must not be used: `rejection` of the message TextureEstimate, which describes each value."""

    NONE = 0
    NOVEL = 1
    AMBIGUOUS = 2
    OUTSIDE_TRAINING = 3
    TOO_LITTLE_EVIDENCE = 4
    NO_MODEL = 5
    TOO_LITTLE_TRAINING = 6


@dataclass(frozen=True)
class TextureEstimate:
    """Which surface is being touched; label '' and no probabilities while there is no evidence.

    A label of '' with probabilities: several surfaces are equally probable, it is unclassified. There is one
    probability for each label of the model, in the order of its ModelInfo.
    """

    stamp_ns: int
    exploration_id: str
    label: str = ''
    rejection: Rejection = Rejection.TOO_LITTLE_EVIDENCE
    confidence: float = math.nan
    probabilities: tuple[float, ...] = ()
    decided: bool = False
    prediction_set: tuple[str, ...] = ()
    windows: int = 0
    evidence_s: float = 0.0
    final: bool = False
    processing_s: float = 0.0
    model: str = ''
    message: str = ''
    frame_id: str = ''
    revision: int = 0

    @property
    def accepted(self) -> bool:
        """Whether the label may be used: it is not rejected."""
        return self.rejection is Rejection.NONE


@dataclass(frozen=True)
class ModelInfo:
    """The model behind the estimates of the same `model` and `revision`: its labels, in the order of probabilities."""

    stamp_ns: int
    model: str = ''
    revision: int = 0
    labels: tuple[str, ...] = ()
    feature_set: str = ''
    frame_id: str = ''


@dataclass(frozen=True)
class RoughnessEstimate:
    """How rough the surface is, 1 (smooth) to 5 (rough); not valid while there is no grade."""

    stamp_ns: int
    exploration_id: str
    valid: bool = False
    grade: float = math.nan
    grade_std: float = math.nan
    windows: int = 0
    evidence_s: float = 0.0
    final: bool = False
    processing_s: float = 0.0
    model: str = ''
    message: str = ''
    frame_id: str = ''


# --------------------
# Request to the exploring finger, and its state.


class Phase(str, enum.Enum):
    """Phase of an exploration; windows are cut from SLIDE alone."""

    IDLE = 'idle'
    APPROACH = 'approach'
    CONTACT = 'contact'
    SLIDE = 'slide'
    LIFT = 'lift'
    DONE = 'done'
    ABORTED = 'aborted'

    @property
    def code(self) -> int:
        """Number of the phase in the message ExplorationState."""
        return tuple(Phase).index(self)


ENDED = frozenset({Phase.IDLE, Phase.DONE, Phase.ABORTED})


@dataclass(frozen=True)
class ExplorationState:
    """State of the finger from `stamp_ns` on; unknown numbers are NaN, unknown names ''.

    `steady_s` guarantees that phase, speed and force hold at least that long after the stamp. A window can be used as
    soon as its last sample arrives, without waiting for the next state.
    """

    stamp_ns: int
    exploration_id: str
    motion: str
    phase: Phase
    steady_s: float = 0.0
    speed_m_s: float = math.nan
    force_n: float = math.nan
    direction_rad: float = math.nan
    progress: float = math.nan
    surface: str = ''
    x_m: float = math.nan
    y_m: float = math.nan
    z_m: float = math.nan
    frame_id: str = ''
    tangential_force_n: float = math.nan
    error_code: int = 0  # an ExplorationError, 0 before the end
    lifted: bool = False  # known to be free of the surface


@dataclass(frozen=True)
class ExplorationRequest:
    """Request of an operator; a number of 0 means the default of the motion, a `timeout_s` of 0 no timeout.

    Raises
    ------
    InvalidData
        If `surface` is no label (see `texture_core.types`), `timeout_s` is negative or not finite, or a start is given
        that is not used.
    """

    motion: str
    speed_m_s: float = 0.0
    force_n: float = 0.0
    distance_m: float = 0.0
    radius_m: float = 0.0
    turns: float = 0.0
    duration_s: float = 0.0
    direction_rad: float = 0.0
    surface: str = ''
    early_stopping: bool = False
    timeout_s: float = 0.0
    use_start: bool = False  # travel first to the start, in the frame of the surface; see `SurfacePatch`
    start_x_m: float = 0.0
    start_y_m: float = 0.0

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, 'surface', checked_label(self.surface))
        except InvalidData as error:
            raise InvalidData(str(error), 'surface') from error
        if not self.use_start and (self.start_x_m or self.start_y_m):
            raise InvalidData(
                f'the start is ({self.start_x_m:g}, {self.start_y_m:g}) m, but use_start is false; set it, or leave '
                'start_x_m and start_y_m at 0',
                'use_start',
            )
        if not 0.0 <= self.timeout_s < math.inf:
            raise InvalidData(
                f'timeout_s is {self.timeout_s}; 0, for none, or a positive number of seconds is needed', 'timeout'
            )


# --------------------
# Data classes to messages and back, with the message classes of rclpy, or of rosbags without ROS.

DATA_CLASSES = (
    TactileSignal, ExplorationState, FeatureVector, TextureEstimate, RoughnessEstimate, ModelInfo, ExplorationRequest,
)  # fmt: skip
STAMPS = ('stamp_ns', 'start_ns')  # field that is stored in the header
# Fields that messages hold in standard types: times in s as a builtin_interfaces/Duration, and coordinates as the
# geometry_msgs/Point `position`.
DURATIONS: Mapping[str, str] = {'steady_s': 'steady', 'timeout_s': 'timeout', 'duration_s': 'duration'}
POSITION = ('x_m', 'y_m', 'z_m')
MAX_DURATION_S = 2.0**31
Convert = Callable[[Any], Any] | None  # None: the value is the same in both


class MessageCodec:
    """Turn data classes into messages and back: field by field of the same name, the time in the header."""

    def __init__(self, kind: Callable[[str], Any], convert: Mapping[Any, tuple[Convert, Convert]]) -> None:
        self._kind = kind
        self._convert = {
            float: (float, None),
            tuple[str, ...]: (list, tuple),
            Phase: (lambda phase: phase.code, _phase),
            Rejection: (int, _rejection),
            **convert,
        }
        # By class: its field that is the time in the header, whether it has a position, and of each other field both
        # names and the conversion of the value.
        self._plans: dict[type, tuple[str, bool, list[tuple[str, str, Convert, Convert]]]] = {}

    def to_message(self, value: Any) -> Any:
        """Return the message of a data class; InvalidData if a time in s is more than the message can hold."""
        cls = type(value)
        stamp, has_position, rest = self._plans.get(cls) or self._plan(cls)
        values = {there: wire(getattr(value, here)) if wire else getattr(value, here) for here, there, wire, _ in rest}
        if stamp:
            time = self._time('builtin_interfaces/msg/Time', getattr(value, stamp))
            values['header'] = self._kind('std_msgs/msg/Header')(stamp=time, frame_id=value.frame_id)
        if has_position:
            numbers = {name[0]: float(getattr(value, name)) for name in POSITION}
            values['position'] = self._kind('geometry_msgs/msg/Point')(**numbers)
        return self._kind(f'texture_msgs/msg/{cls.__name__}')(**values)

    def from_message(self, message: Any, cls: type) -> Any:
        """Return the data class of a message; InvalidData if the message is inconsistent."""
        stamp, has_position, rest = self._plans.get(cls) or self._plan(cls)
        values = {
            here: back(getattr(message, there)) if back else getattr(message, there) for here, there, _, back in rest
        }
        if stamp:
            values[stamp], values['frame_id'] = _nanoseconds(message.header.stamp), message.header.frame_id
        if has_position:
            values.update({name: getattr(message.position, name[0]) for name in POSITION})
        if cls is TactileSignal:
            flat, channels = values['samples'], len(values['channels'])
            if not channels or len(flat) % channels:
                raise InvalidData(
                    f"signal message of '{message.sensor}' has {len(flat)} samples for {counted(channels, 'channel')}; "
                    'a multiple of the number of channels is needed'
                )
            values['samples'] = flat.reshape(-1, channels)
        return cls(**values)

    def _plan(self, cls: type) -> tuple[str, bool, list[tuple[str, str, Convert, Convert]]]:
        types = get_type_hints(cls)
        stamp = next((name for name in STAMPS if types.pop(name, None)), '')
        types.pop('frame_id', None)  # also in the header
        has_position = POSITION[0] in types
        for name in POSITION:
            types.pop(name, None)
        duration = self._duration, lambda duration: _nanoseconds(duration) / NANOSECONDS
        rest = [
            (
                name,
                DURATIONS.get(name, name),
                *(duration if name in DURATIONS else self._convert.get(kind, (None, None))),
            )
            for name, kind in types.items()
        ]
        kind = self._kind(f'texture_msgs/msg/{cls.__name__}')
        known = {*dir(kind), *getattr(kind, '__annotations__', ())}
        if missing := [there for _, there, _, _ in rest if there not in known]:
            raise InvalidData(
                f'the message {cls.__name__} has no {" or ".join(missing)}: the messages are older than the code; run '
                '`make setup` and start the nodes again'
            )
        return self._plans.setdefault(cls, (stamp, has_position, rest))

    def _time(self, name: str, time_ns: int) -> Any:
        seconds, nanoseconds = divmod(int(time_ns), NANOSECONDS)
        return self._kind(name)(sec=seconds, nanosec=nanoseconds)

    def _duration(self, seconds: float) -> Any:
        if not abs(seconds) < MAX_DURATION_S:
            raise InvalidData(f'a time is {seconds:g} s; less than {MAX_DURATION_S:g} s is allowed')
        return self._time('builtin_interfaces/msg/Duration', round(seconds * NANOSECONDS))


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


def _phase(code: int) -> Phase:
    phases = tuple(Phase)
    if code >= len(phases):
        allowed = ', '.join(f'{phase.code} ({phase.value})' for phase in phases)
        raise InvalidData(f'exploration state has the phase {code}; allowed are {allowed}')
    return phases[code]


def _rejection(code: int) -> Rejection:
    try:
        return Rejection(code)
    except ValueError as error:
        allowed = ', '.join(f'{known.value} ({known.name.lower()})' for known in Rejection)
        raise InvalidData(f'a texture estimate has the rejection {code}; allowed are {allowed}') from error


# --------------------
# How a finger slides, and which slides are of one kind.

# Slides that differ by no more are of one kind: an arm reaches requested speed and force within this tolerance.
TURNED_RAD, SPEED_RATIO, FORCE_RATIO = 0.1, 1.15, 1.3


@dataclass(frozen=True)
class SlideMotion:
    """One way to slide."""

    motion: str
    direction_rad: float
    speed_m_s: float
    force_n: float
    duration_s: float

    def is_similar(self, other: SlideMotion) -> bool:
        """Return whether both are of one kind; how long they last does not matter."""
        return (
            self.motion == other.motion
            and abs(math.remainder(self.direction_rad - other.direction_rad, math.tau)) <= TURNED_RAD
            and _within(self.speed_m_s, other.speed_m_s, SPEED_RATIO)
            and _within(self.force_n, other.force_n, FORCE_RATIO)
        )


def group_similar(motions: Sequence[SlideMotion]) -> list[SlideMotion]:
    """Return for each motion the median of its group; a motion joins the first group whose first motion is similar."""
    founders: list[SlideMotion] = []
    groups = []
    for motion in motions:
        group = next((k for k, founder in enumerate(founders) if motion.is_similar(founder)), len(founders))
        if group == len(founders):
            founders.append(motion)
        groups.append(group)
    medians = [
        _median([motion for motion, one in zip(motions, groups, strict=True) if one == k]) for k in range(len(founders))
    ]
    return [medians[group] for group in groups]


def _median(motions: Sequence[SlideMotion]) -> SlideMotion:
    """Return the motion with the medians of all numbers, rounded to three digits."""
    heading = cmath.phase(sum(cmath.rect(1.0, motion.direction_rad) for motion in motions))
    speed, force, duration = (
        float(f'{median(getattr(motion, name) for motion in motions):.3g}')
        for name in ('speed_m_s', 'force_n', 'duration_s')
    )
    return replace(motions[0], direction_rad=round(heading, 3), speed_m_s=speed, force_n=force, duration_s=duration)


def _within(one: float, other: float, factor: float) -> bool:
    return one <= other * factor and other <= one * factor


# --------------------
# Folder of emulated devices, and the state of the finger that emulated arms send to the emulator there.

# As $(env XDG_RUNTIME_DIR /tmp)/tactile_texture of the launch files.
DEVICES = f'{os.environ.get("XDG_RUNTIME_DIR", "/tmp")}/tactile_texture'

FORMAT = struct.Struct('<4sq7d')
MAGIC = b'TTF1'
READ_BYTES = 960 * FORMAT.size  # nearly what a pipe of Linux holds: states of 2 s at 500 Hz


def loopback_address(ip: str) -> str:
    """Return an IP address as it is, and for a path the loopback address that an emulated controller has by that path.

    The ports of a controller are fixed, so that each emulated one needs a separate address. Two paths have the same
    one with a probability of 1 in 16 million.
    """
    if '/' not in ip:
        return ip
    return '.'.join(['127', *(str(1 + byte % 254) for byte in hashlib.sha256(ip.encode()).digest()[:3])])


@dataclass(frozen=True)
class FingerState:
    """Position, velocity and normal force of a fingertip at one time, in the frame of the surface.

    x and y are in the surface, z points away from it; m, m/s and N. `time_ns` is of CLOCK_MONOTONIC, which is common
    to all processes of one machine: the receiver extrapolates from it.
    """

    time_ns: int
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    vx_m_s: float = 0.0
    vy_m_s: float = 0.0
    vz_m_s: float = 0.0
    force_n: float = 0.0

    def to_bytes(self) -> bytes:
        """Return the state as sent: magic, time, seven doubles, little endian."""
        return FORMAT.pack(MAGIC, *astuple(self))


class FingerSender:
    """Sends finger states into the named pipe of an emulator, if it exists; the path '' sends none."""

    def __init__(self, path: str) -> None:
        self._path = str(Path(path).expanduser()) if path else ''
        self._pipe: int | None = None

    def send(self, state: FingerState) -> None:
        """Send one state; it is lost without a reader, or if the pipe is full."""
        if not self._path:
            return
        try:
            if self._pipe is None:
                self._pipe = os.open(self._path, os.O_WRONLY | os.O_NONBLOCK)
            os.write(self._pipe, state.to_bytes())  # as a whole: it is shorter than PIPE_BUF
        except BlockingIOError:
            pass
        except OSError:
            self.close()

    def close(self) -> None:
        """Close the pipe; the next state opens it again."""
        if self._pipe is not None:
            os.close(self._pipe)
            self._pipe = None


class FingerReceiver:
    """The emulator's end of the named pipe at a path, which it creates and removes."""

    def __init__(self, path: str) -> None:
        self._path = Path(path).expanduser()
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            if not self._path.is_fifo():
                os.mkfifo(self._path)
            self._pipe = os.open(self._path, os.O_RDWR | os.O_NONBLOCK)  # also to write: it stays open without a sender
        except OSError as error:
            raise DeviceError(
                f"the pipe '{path}' for the finger cannot be made: {error}; choose a path in a folder that you may "
                'write to, where no other file exists'
            ) from error
        try:
            fcntl.flock(self._pipe, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(self._pipe)
            raise DeviceError(
                f"another emulator uses the pipe '{path}' for the finger; end it, or give this one a namespace"
            ) from error

    def states(self, wait_s: float = 0.0) -> list[FingerState]:
        """Return what has arrived since the last call; if nothing has, wait up to `wait_s` for the first."""
        if wait_s:
            select.select([self._pipe], [], [], wait_s)
        data = b''
        with contextlib.suppress(BlockingIOError):
            data = os.read(self._pipe, READ_BYTES)  # whole states, as each is written as a whole
        rows = FORMAT.iter_unpack(data[: len(data) // FORMAT.size * FORMAT.size])
        return [FingerState(*numbers) for magic, *numbers in rows if magic == MAGIC]

    def close(self) -> None:
        """Remove the pipe."""
        self._path.unlink(missing_ok=True)
        os.close(self._pipe)


# --------------------
# Rotation vectors and quaternions, as robots use them.


def rotation_matrix(rotation_vector_rad: Sequence[float] | Array) -> Array:
    """Return the matrix that turns about a vector by its length (Rodrigues' formula)."""
    x, y, z = rotation_vector_rad
    angle = float(np.sqrt(x * x + y * y + z * z))
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(a)/a and (1 − cos a)/a² in a form that holds for a = 0; numpy's sinc(t) is sin(πt)/(πt).
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.eye(3) + first * cross + second * cross @ cross


def quaternion(rotation_vector_rad: Sequence[float] | Array) -> tuple[float, float, float, float]:
    """Return the quaternion x, y, z, w of ROS that turns about a vector by its length."""
    vector = np.array(rotation_vector_rad, dtype=float)
    half = 0.5 * float(np.linalg.norm(vector))
    x, y, z = (0.5 * np.sinc(half / np.pi) * vector).tolist()  # sin(half)/|r| in a form that holds for 0
    return x, y, z, float(np.cos(half))


def quaternion_matrix(quaternion: Sequence[float]) -> Array:
    """Return the matrix of a rotation that is given as the quaternion x, y, z, w of ROS."""
    vector, w = np.array(quaternion[:3], dtype=float), float(quaternion[3])
    length = float(np.linalg.norm(vector))
    if length == 0.0 == w:
        return np.full((3, 3), np.nan)
    return rotation_matrix(2.0 * np.arctan2(length, w) / (length or 1.0) * vector)


def rotation_vector(matrix: Array) -> Array:
    """Return the rotation vector of a rotation, the inverse of `rotation_matrix`."""
    # The quaternion from its largest component is exact also at half a turn (Shepperd 1978).
    trace = float(np.trace(matrix))
    squares = np.array([*(1.0 + 2.0 * np.diag(matrix) - trace), 1.0 + trace])  # 4·x², 4·y², 4·z², 4·w²
    largest = int(np.argmax(squares))
    products = matrix + matrix.T  # 4·x·y and so on off the diagonal
    differences = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    if largest == 3:
        quaternion = np.array([*differences, squares[3]])
    else:
        quaternion = np.array([*products[largest], differences[largest]])
        quaternion[largest] = squares[largest]
    quaternion = quaternion / np.linalg.norm(quaternion)
    if quaternion[3] < 0.0:
        quaternion = -quaternion
    length = float(np.linalg.norm(quaternion[:3]))
    if length == 0.0:
        return np.zeros(3)
    return quaternion[:3] * (2.0 * np.arctan2(length, quaternion[3]) / length)


# --------------------
# Protocols between the parts of the suite.


class Sensor(Protocol):
    """A tactile sensor: opened, read in batches, closed; any number of times.

    `read` blocks for about one batch and returns what arrived, keyed by topic ('signal', 'signal_static');
    it may return nothing. A device that is gone raises DeviceError from `open` or `read`; the caller closes and
    opens again. `counts` are running totals of this sensor object, kept over reopening. A sensor may also have
    `details`: what it reports about itself, such as its 'serial number', by name, for the diagnostics; and `limits`:
    the lowest and the highest sample by topic, of all channels or of each, to detect saturation.
    """

    def open(self) -> None:
        """Open the device and start its stream; DeviceError if it cannot be reached."""

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches completed since the last call, by topic."""

    def close(self) -> None:
        """Stop the stream and close the device; never raises, may be called twice."""

    @property
    def counts(self) -> Mapping[str, int]:
        """Running totals, such as 'samples', 'lost', 'bogus' and 'reopened'."""

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic, for the diagnostics."""
