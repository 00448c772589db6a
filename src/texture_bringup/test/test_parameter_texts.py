# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import pytest
from rcl_interfaces.msg import ParameterType

from texture_bringup.operator import parameter_from_text
from texture_core.errors import InvalidParameter

pytestmark = pytest.mark.ros


@pytest.mark.parametrize(
    ('kind', 'text', 'value'),
    [
        (ParameterType.PARAMETER_BOOL, 'False', False),
        (ParameterType.PARAMETER_INTEGER, '1', 1),
        (ParameterType.PARAMETER_DOUBLE, '0', 0.0),  # which a node refuses as an integer
        (ParameterType.PARAMETER_STRING, '12', '12'),
    ],
)
def test_a_text_is_read_as_the_type_that_the_node_declared(kind, text, value) -> None:
    read = parameter_from_text('x', text, kind)
    assert (read.value, type(read.value)) == (value, type(value))


@pytest.mark.parametrize(
    ('kind', 'text', 'sentence'),
    [
        (ParameterType.PARAMETER_BOOL, 'no', "parameter 'x' is 'no'; allowed is true or false"),
        (ParameterType.PARAMETER_DOUBLE, 'much', 'allowed is a number'),
        (ParameterType.PARAMETER_DOUBLE_ARRAY, '1', "'x' is a list"),
    ],
)
def test_what_is_no_value_is_refused_with_a_sentence(kind, text, sentence) -> None:
    with pytest.raises(InvalidParameter, match=sentence):
        parameter_from_text('x', text, kind)
