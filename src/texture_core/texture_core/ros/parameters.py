"""Declare the fields of a parameter dataclass as ROS parameters and read them back, checked."""

from __future__ import annotations

import typing
from collections.abc import Callable
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.parameter import Parameter as RosParameter

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter
from texture_core.parameters import Parameter, from_mapping, parameters_of

T = TypeVar('T')
TYPES = {
    bool: RosParameter.Type.BOOL,
    int: RosParameter.Type.INTEGER,
    float: RosParameter.Type.DOUBLE,
    str: RosParameter.Type.STRING,
    list[str]: RosParameter.Type.STRING_ARRAY,
    list[float]: RosParameter.Type.DOUBLE_ARRAY,
}
UNBOUNDED = 1e300


def declare(node: Any, cls: type[T], *, changeable: bool = False) -> T:
    """Declare every field of `cls` with its description, unit and range; return the values the node was given.

    Parameters
    ----------
    node
        The rclpy node that gets the parameters.
    cls
        Parameter dataclass.
    changeable
        Whether a running node follows changes (see `on_change`). If not, the parameters are read-only after the start:
        a change that had no effect would look as if it had one.

    Returns
    -------
    instance of `cls`
        Checked.

    Raises
    ------
    InvalidParameter
        If a given value has the wrong type or range.
    """
    for item in parameters_of(cls):
        if node.has_parameter(item.name):
            continue
        try:
            node.declare_parameter(item.name, item.default, _descriptor(item, read_only=not changeable))
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            raise InvalidParameter(
                f"parameter '{item.name}' of node '{node.get_name()}' was refused: {error}; {_needed(item)}"
            ) from error
    return read(node, cls)


def read(node: Any, cls: type[T]) -> T:
    """Return the declared parameters of `cls` with their present values."""
    return from_mapping(cls, {item.name: node.get_parameter(item.name).value for item in parameters_of(cls)})


def on_change(node: Any, cls: type[T], apply: Callable[[T], None]) -> None:
    """Call `apply` with the new values before a change of parameters is accepted; what it refuses is not set.

    Parameters
    ----------
    node
        The rclpy node whose parameters were declared.
    cls
        Parameter dataclass, as it was declared.
    apply
        Takes all values; it refuses them by raising a TextureError.
    """
    known = {item.name for item in parameters_of(cls)}

    def check(changes: list[RosParameter]) -> SetParametersResult:
        changed = {change.name: change.value for change in changes if change.name in known}
        if not changed:
            return SetParametersResult(successful=True)
        present = {name: node.get_parameter(name).value for name in known}
        try:
            apply(from_mapping(cls, {**present, **changed}))
        except InvalidParameter as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)


def warn_of_unknown(node: Any) -> None:
    """Log a warning for each parameter that was given and is unknown: a mistyped limit limits nothing."""
    declared = set(node._parameters)
    for name in sorted(set(node._parameter_overrides) - declared):
        if not name.startswith('qos_overrides.'):
            node.get_logger().warning(f'this has no effect: {unknown_name(name, declared, "parameter")}')


def _needed(item: Parameter) -> str:
    return f'{TYPES[item.type].name.lower()} {item.range_text}'.strip() + ' is needed'


def _descriptor(item: Parameter, *, read_only: bool) -> ParameterDescriptor:
    unit = f' [{item.unit}]' if item.unit else ''
    descriptor = ParameterDescriptor(
        name=item.name,
        type=TYPES[item.type].value,
        description=f'{item.description}{unit}',
        additional_constraints=item.range_text if item.choices else '',
        # A YAML file may give 1 where 1.0 is meant; check() makes it a number of the right type.
        dynamic_typing=False,
        read_only=read_only,
    )
    if item.low is None and item.high is None:
        return descriptor
    low = item.low if item.low is not None else -UNBOUNDED
    high = item.high if item.high is not None else UNBOUNDED
    if item.type is int:
        limits = IntegerRange(from_value=int(max(low, -(2**62))), to_value=int(min(high, 2**62)))
        descriptor.integer_range = [limits]
    elif item.type is float or typing.get_origin(item.type) is None:
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=float(high))]
    return descriptor
