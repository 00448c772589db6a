"""RTDE, protocol version 2, as the controller speaks it: one session per connection."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

from texture_simulation.devices.ur.controller import EmulatedController
from texture_simulation.devices.ur.tables import FORMATS, RtdeMessage
from texture_simulation.devices.ur.variables import INPUTS, OUTPUTS, Getter, Setter

HEADER = struct.Struct('>HB')
PROTOCOL_VERSION = 2
OUTPUT_RECIPE = 1


class InputClaims(dict[str, 'RtdeSession']):
    """Who writes which input: each may belong to one session only."""


class RtdeSession:
    """The conversation with one client; `package` is what it gets each cycle once it has asked for it."""

    def __init__(self, controller: EmulatedController, claims: InputClaims) -> None:
        self._controller = controller
        self._claims = claims
        self._received = b''
        self._output_format = struct.Struct('>')
        self._getters: list[Getter] = []
        self._every_s = controller.step_s
        self._due_s = 0.0
        self._started = False
        self._inputs: list[InputRecipe] = []

    def greeting(self) -> bytes:
        """Say nothing at the start."""
        return b''

    def receive(self, data: bytes) -> bytes:
        """Take over what came; return the answers."""
        self._received += data
        answers = b''
        while (packet := self._take_packet()) is not None:
            kind, payload = packet
            handler = HANDLERS.get(kind)
            answer = handler(self, payload) if handler is not None else None
            answers += _message(kind, answer) if answer is not None else b''
        return answers

    def _take_packet(self) -> tuple[int, bytes] | None:
        """Return the kind and the content of the next packet; None if it is not complete."""
        if len(self._received) < HEADER.size:
            return None
        size, kind = HEADER.unpack_from(self._received)
        if size < HEADER.size:
            self._received = b''
        if len(self._received) < size or size < HEADER.size:
            return None
        payload, self._received = self._received[HEADER.size : size], self._received[size:]
        return kind, payload

    def close(self) -> None:
        """Give the inputs free."""
        for name in [name for name, owner in self._claims.items() if owner is self]:
            del self._claims[name]

    def package(self) -> bytes:
        """Return the data message if one is due, else nothing."""
        controller = self._controller
        if not self._started or controller.time_s < self._due_s - 0.5 * controller.step_s:
            return b''
        self._due_s = max(self._due_s + self._every_s, controller.time_s)
        values = [value for getter in self._getters for value in getter(controller)]
        return _message(RtdeMessage.DATA, bytes([OUTPUT_RECIPE]) + self._output_format.pack(*values))

    def _on_request_version(self, payload: bytes) -> bytes:
        return bytes([payload == struct.pack('>H', PROTOCOL_VERSION)])

    def _on_controller_version(self, _payload: bytes) -> bytes:
        return struct.pack('>4I', *self._controller.version.numbers)

    def _on_setup_outputs(self, payload: bytes) -> bytes | None:
        if len(payload) < 8:
            return None
        (frequency_hz,) = struct.unpack_from('>d', payload)
        self._every_s = max(1.0 / frequency_hz if frequency_hz > 0 else 0.0, self._controller.step_s)
        names = _names(payload[8:])
        types = [OUTPUTS[name][0] if name in OUTPUTS else 'NOT_FOUND' for name in names]
        if 'NOT_FOUND' not in types:
            self._getters = [OUTPUTS[name][1] for name in names]
            self._output_format = _format(types)
        return bytes([OUTPUT_RECIPE]) + ','.join(types).encode()

    def _on_setup_inputs(self, payload: bytes) -> bytes:
        names = _names(payload)
        types = [self._input_type(name) for name in names]
        if not {'NOT_FOUND', 'IN_USE'} & set(types):
            self._claims.update(dict.fromkeys(names, self))
            self._inputs.append(InputRecipe(names))
        return bytes([len(self._inputs)]) + ','.join(types).encode()

    def _input_type(self, name: str) -> str:
        if name not in INPUTS:
            return 'NOT_FOUND'
        return INPUTS[name][0] if self._claims.get(name, self) is self else 'IN_USE'

    def _on_start(self, _payload: bytes) -> bytes:
        self._started = True
        return b'\x01'

    def _on_pause(self, _payload: bytes) -> bytes:
        self._started = False
        return b'\x01'

    def _on_data(self, payload: bytes) -> None:
        if payload and 1 <= payload[0] <= len(self._inputs):
            self._inputs[payload[0] - 1].write(self._controller, payload[1:])


class InputRecipe:
    """A list of inputs that are written together."""

    def __init__(self, names: list[str]) -> None:
        self._format = _format([INPUTS[name][0] for name in names])
        self._setters: list[tuple[Setter, int]] = [
            (INPUTS[name][1], len(struct.unpack(fields, bytes(struct.calcsize(fields)))))
            for name in names
            for fields in ['>' + FORMATS[INPUTS[name][0]]]
        ]

    def write(self, controller: EmulatedController, data: bytes) -> None:
        """Write the values in `data`; what has another length is not taken."""
        if len(data) != self._format.size:
            return
        values = self._format.unpack(data)
        start = 0
        for setter, count in self._setters:
            setter(controller, values[start : start + count])
            start += count


HANDLERS: Mapping[int, Callable[[RtdeSession, bytes], bytes | None]] = {
    RtdeMessage.REQUEST_VERSION: RtdeSession._on_request_version,
    RtdeMessage.CONTROLLER_VERSION: RtdeSession._on_controller_version,
    RtdeMessage.SETUP_OUTPUTS: RtdeSession._on_setup_outputs,
    RtdeMessage.SETUP_INPUTS: RtdeSession._on_setup_inputs,
    RtdeMessage.START: RtdeSession._on_start,
    RtdeMessage.PAUSE: RtdeSession._on_pause,
    RtdeMessage.DATA: RtdeSession._on_data,
}


def _message(kind: int, payload: bytes) -> bytes:
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def _names(data: bytes) -> list[str]:
    """Return the names of a list, which may end with a comma."""
    return [name for name in data.decode('ascii', 'replace').split(',') if name]


def _format(types: list[str]) -> struct.Struct:
    return struct.Struct('>' + ''.join(FORMATS[name] for name in types))
