# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A simulated arm with faults, over a shaped surface; also one that takes velocities only, which come late."""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from texture_exploration.arms.simulated import SimulatedArm, SimulatedArmParams
from texture_exploration.force_control import ForceLoop, ForceLoopParams

BASE_STIFFNESS_N_M = 20000.0  # of a wall
HOLDS_S = 0.02  # for which it keeps a velocity without a new one
STEEPEST = 1.0  # slope that the force mode follows
PERIOD_S = 0.004


class Shape(NamedTuple):
    """Of the surface, along x."""

    tilt_rad: float = 0.0
    step_m: float = 0.0
    edge_m: float = math.inf
    wall_m: float = math.inf

    def height_m(self, x_m):
        return x_m * math.tan(self.tilt_rad) + (self.step_m if x_m >= 0.06 else 0.0)


PLANE = Shape()


@dataclass(frozen=True)
class TableArmParams(ForceLoopParams, SimulatedArmParams):
    loop_delay_s: float = 0.008
    force_mode: bool = True
    force_noise_n: float = 0.001  # without a force mode


class TableArm(SimulatedArm):
    """Faults last until it is connected again."""

    def __init__(self, params, clock, shape=PLANE):
        self._shape, self._rng = shape, np.random.default_rng(1)
        self._loop = None if params.force_mode else ForceLoop(params, PERIOD_S)
        self.noisy_force = not params.force_mode and params.force_noise_n > 0.0
        self._coming, self._velocity, self._since_ns, self._done_ns = deque(), (0.0, 0.0, 0.0), 0, clock()
        super().__init__(params, clock, own_thread=False)
        if self._loop:
            self._state = replace(self._state, delay_s=params.loop_delay_s)

    def connect(self):
        self._frozen, self._jammed, self._fault, self.push_n = False, False, '', 0.0
        self._stuck_n, self._drift_n, self._drift_n_s = None, 0.0, 0.0
        self.true_force_n = 0.0
        super().connect()

    def freeze(self):
        """Hang like a controller: an old state, no effect of commands."""
        self._frozen = True

    def jam(self):
        """Be blocked along the surface."""
        self._jammed = True

    def fail(self, reason):
        """Stop and give a reason, as in a protective stop."""
        self._fault = reason
        self._state = replace(self._state, velocity=(0.0, 0.0, 0.0), fault=reason)

    def push(self, force_n):
        self.push_n = force_n

    def freeze_force(self):
        self._stuck_n = self._state.force_n

    def drift_force(self, rate_n_s):
        self._drift_n_s = rate_n_s

    def displace(self, distance_m):
        x, y, z = (at + step_m for at, step_m in zip(self._state.position, distance_m, strict=True))
        self._state = replace(self._state, position=(x, y, z))

    def step(self, dt_s):
        if self._frozen:
            return
        if self._fault:
            self.stop()
        self._drift_n += self._drift_n_s * dt_s
        super().step(dt_s)
        wall_n = -BASE_STIFFNESS_N_M * max(0.0, self._state.position[0] - self._shape.wall_m)
        self._state = replace(self._state, along_n=(wall_n, 0.0), fault=self._fault)
        if self._loop:
            due_ns = self._clock() + round(self._params.loop_delay_s * 1e9)
            command = self._last_command[0]
            self._coming.append((due_ns, self._loop.velocity(command, self._state, min(dt_s, HOLDS_S))))
            self._state = replace(self._state, unsafe=self._loop.doubt)

    def _force_n(self, x_m, z_m):
        depth_m = self._shape.height_m(x_m) - z_m
        spring_n = self._params.stiffness_n_m * max(0.0, depth_m) if x_m < self._shape.edge_m else 0.0
        self.true_force_n = spring_n + self.push_n
        if self._stuck_n is not None:
            return self._stuck_n
        noise_n = self._params.force_noise_n * self._rng.standard_normal() if self._loop else 0.0
        return self.true_force_n + self._drift_n + noise_n

    def _moved_m(self, command, dt_s):
        if self._loop:
            moved = self._late_m(self._clock())
        else:
            moved = super()._moved_m(command, dt_s)
            x_m = self._state.position[0]
            rise_m = self._shape.height_m(x_m + moved[0]) - self._shape.height_m(x_m)
            presses = command.force_n is not None and self._state.force_n > 0
            if presses and abs(rise_m) <= STEEPEST * abs(moved[0]):  # a step is met or lost, not followed
                moved = (*moved[:2], moved[2] + rise_m)
        return (0.0, 0.0, moved[2]) if self._jammed else moved

    def _late_m(self, now_ns):
        """Return the distance since the last call, by velocities that came into effect since."""
        travelled = np.zeros(3)
        for begin_ns, velocity in [*self._coming, (now_ns, None)]:
            until_ns = min(begin_ns, now_ns)
            held_s = max(0, min(until_ns, self._since_ns + round(HOLDS_S * 1e9)) - self._done_ns) * 1e-9
            travelled += np.array(self._velocity) * held_s
            self._done_ns = max(self._done_ns, until_ns)
            if begin_ns > now_ns or velocity is None:
                break
            self._velocity, self._since_ns = velocity, begin_ns
            self._coming.popleft()
        return tuple(travelled.tolist())
