"""Numbers of the rails and of the line to their microcontroller: the machine of Hu et al. 2014, frames of our own.

Orders and answers are frames of `texture_core.framing` with one row and one column, little endian:

| kind | direction | body |
|---|---|---|
| 0xA0 move | to the rails | i32 vx, i32 vy in µm/s; u8 mode; i32 value |
| 0xA1 stop | to the rails | – |
| 0xA2 clear | to the rails | – |
| 0x20 state | from the rails | i32 x, i32 y, i32 z in encoder counts; i32 force in mN; u8 flags; u16 watchdog stops |

A state comes 100 times a second. Modes of the pressing motor: 0 it holds (it locks itself), 1 it moves at `value` µm/s,
positive away from the surface, 2 it presses until `value` mN are reached, and locks. A motor without an encoder counts
the way it was told to go.
"""

from __future__ import annotations

from struct import Struct

VERSION = 1
MOVE, STOP, CLEAR, STATE = 0xA0, 0xA1, 0xA2, 0x20
HOLD, MOVING, PRESS = 0, 1, 2
MOVE_BODY = Struct('<iiBi')
STATE_BODY = Struct('<iiiiBH')
STATE_PERIOD_S = 0.01
WATCHDOG_S = 0.15  # so long an order holds
MICRO, MILLI = 1e6, 1e3

# Flags of a state.
LOW_X, HIGH_X, LOW_Y, HIGH_Y, TOP, LOCKED, OVERLOAD, STALL = (1 << bit for bit in range(8))
FAULTS = {
    OVERLOAD: 'its force sensor was overloaded, and the finger was lifted',
    STALL: 'an encoder does not follow its motor; is something in the way?',
}
