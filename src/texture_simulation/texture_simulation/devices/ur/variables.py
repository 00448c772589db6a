"""The variables that RTDE offers: name, type and how to read it.

The robot has no joints: joint variables stand still at a usual pose. What no client of the suite looks at is constant.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from texture_simulation.devices.ur.controller import EmulatedController
from texture_simulation.devices.ur.registers import COUNT
from texture_simulation.devices.ur.tables import (
    COMMAND_REGISTERS,
    POWER_ON_BIT,
    PROGRAM_PAUSED,
    PROGRAM_PLAYING,
    PROGRAM_RUNNING_BIT,
    PROGRAM_STOPPED,
    ROBOT_RUNNING,
    SAFETY_BITS,
)

Getter = Callable[[EmulatedController], Sequence[Any]]
Variable = tuple[str, Getter]

JOINTS = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
JOINT_RUNNING = 253


def _constant(*values: float) -> Getter:
    return lambda _controller: values


def _register(name: str, index: int) -> Getter:
    return lambda controller: (getattr(controller.registers, name)[index],)


def _status_bits(controller: EmulatedController) -> Sequence[int]:
    return (POWER_ON_BIT | (PROGRAM_RUNNING_BIT if controller.playing else 0),)


def _runtime_state(controller: EmulatedController) -> Sequence[int]:
    if controller.paused:
        return (PROGRAM_PAUSED,)
    return (PROGRAM_PLAYING if controller.playing else PROGRAM_STOPPED,)


OUTPUTS: Mapping[str, Variable] = {
    'timestamp': ('DOUBLE', lambda controller: (controller.time_s,)),
    'actual_TCP_pose': ('VECTOR6D', lambda controller: controller.robot.pose.tolist()),
    'target_TCP_pose': ('VECTOR6D', lambda controller: controller.robot.pose.tolist()),
    'actual_TCP_speed': ('VECTOR6D', lambda controller: controller.robot.velocity.tolist()),
    'target_TCP_speed': ('VECTOR6D', lambda controller: controller.robot.velocity.tolist()),
    'actual_TCP_force': ('VECTOR6D', lambda controller: controller.robot.force.tolist()),
    'ft_raw_wrench': ('VECTOR6D', lambda controller: controller.robot.force.tolist()),
    'safety_mode': ('INT32', lambda controller: (int(controller.safety),)),
    'safety_status_bits': ('UINT32', lambda controller: (SAFETY_BITS[controller.safety],)),
    'robot_status_bits': ('UINT32', _status_bits),
    'runtime_state': ('UINT32', _runtime_state),
    'robot_mode': ('INT32', _constant(ROBOT_RUNNING)),
    'joint_mode': ('VECTOR6INT32', _constant(*(JOINT_RUNNING,) * 6)),
    'actual_tool_accelerometer': ('VECTOR3D', _constant(0.0, 0.0, -9.81)),
    'payload': ('DOUBLE', _constant(0.0)),
    'payload_cog': ('VECTOR3D', _constant(0.0, 0.0, 0.0)),
    'payload_inertia': ('VECTOR6D', _constant(*(0.0,) * 6)),
    'target_q': ('VECTOR6D', _constant(*JOINTS)),
    'actual_q': ('VECTOR6D', _constant(*JOINTS)),
    **{
        name: ('VECTOR6D', _constant(*(0.0,) * 6))
        for name in (
            'target_qd',
            'target_qdd',
            'target_current',
            'target_moment',
            'actual_qd',
            'actual_current',
            'actual_current_as_torque',
            'joint_control_output',
        )
    },
    'joint_temperatures': ('VECTOR6D', _constant(*(30.0,) * 6)),
    'actual_joint_voltage': ('VECTOR6D', _constant(*(48.0,) * 6)),
    'actual_digital_input_bits': ('UINT64', _constant(0)),
    'actual_digital_output_bits': ('UINT64', _constant(0)),
    'actual_execution_time': ('DOUBLE', _constant(0.1)),
    'speed_scaling': ('DOUBLE', _constant(1.0)),
    'target_speed_fraction': ('DOUBLE', _constant(1.0)),
    'actual_momentum': ('DOUBLE', _constant(0.0)),
    'actual_main_voltage': ('DOUBLE', _constant(48.0)),
    'actual_robot_voltage': ('DOUBLE', _constant(48.0)),
    'actual_robot_current': ('DOUBLE', _constant(1.0)),
    'standard_analog_input0': ('DOUBLE', _constant(0.0)),
    'standard_analog_input1': ('DOUBLE', _constant(0.0)),
    'standard_analog_output0': ('DOUBLE', _constant(0.0)),
    'standard_analog_output1': ('DOUBLE', _constant(0.0)),
    **{f'output_int_register_{index}': ('INT32', _register('int_out', index)) for index in range(COUNT)},
    **{f'output_double_register_{index}': ('DOUBLE', _register('double_out', index)) for index in range(COUNT)},
}

Setter = Callable[[EmulatedController, Sequence[Any]], None]


def _write(name: str, index: int) -> Setter:
    def setter(controller: EmulatedController, values: Sequence[Any]) -> None:
        getattr(controller.registers, name)[index] = values[0]

    return setter


def _write_command(index: int) -> Setter:
    """Write a command register; the watchdog watches that of the program."""

    def setter(controller: EmulatedController, values: Sequence[Any]) -> None:
        controller.registers.int_in[index] = values[0]
        if index == controller.first_register:
            controller.registers.heard(controller.time_s)

    return setter


def _ignore(_controller: EmulatedController, _values: Sequence[Any]) -> None:
    return


INPUTS: Mapping[str, tuple[str, Setter]] = {
    **{f'input_int_register_{index}': ('INT32', _write('int_in', index)) for index in range(COUNT)},
    **{f'input_double_register_{index}': ('DOUBLE', _write('double_in', index)) for index in range(COUNT)},
    **{f'input_int_register_{index}': ('INT32', _write_command(index)) for index in COMMAND_REGISTERS},
    'external_force_torque': ('VECTOR6D', _ignore),
}
