import pytest

from texture_bringup.launcher import parameter_value
from texture_core.errors import InvalidLaunch, UnknownName

VARIABLES = {'$(var n)': '5', '$(var x)': '0.5', '$(var t)': 'cork', '$(var e)': '', '$(var b)': '[1'}


def expand(text):
    for call, value in VARIABLES.items():
        text = text.replace(call, value)
    return text


@pytest.mark.parametrize(
    ('text', 'type_name', 'value'),
    [
        ('5', 'yaml', 5),
        ('5.0', 'yaml', 5.0),
        ('true', 'yaml', True),
        ("'5'", 'yaml', '5'),
        ('cork', 'yaml', 'cork'),
        ('', 'yaml', ''),
        ('@home', 'yaml', '@home'),
        ('5', 'str', '5'),
        ('5', 'float', 5.0),
        ('1', 'bool', True),
        ('[1, 2]', 'yaml', [1, 2]),
        ('[a, b]', 'list_of_str', ['a', 'b']),
        ('$(var n)', 'yaml', 5),
        ("'$(var n)'", 'yaml', 5),
        ('$(var n)', 'str', '5'),
        ('$(var n)', 'float', 5.0),
        ('$(var t)/$(var n)', 'yaml', 'cork/5'),
        ('$(var e)', 'yaml', ''),
        ('[$(var n), 6]', 'yaml', [5, 6]),
        ('[$(var t), birch]', 'yaml', ['cork', 'birch']),
    ],
)
def test_values_are_typed_as_yaml_does_unless_a_type_is_given(text, type_name, value) -> None:
    got = parameter_value(text, type_name, expand)
    assert got == value
    assert type(got) is type(value)


@pytest.mark.parametrize(
    ('text', 'type_name'),
    [
        ('rough', 'float'),
        ('$(var t)', 'int'),
        ('{a: 1}', 'yaml'),
        ('null', 'yaml'),
        ('[1, a]', 'yaml'),
        ('3', 'list_of_int'),
    ],
)
def test_a_value_of_another_type_is_refused(text, type_name) -> None:
    with pytest.raises(InvalidLaunch, match='parameter value'):
        parameter_value(text, type_name, expand)


def test_an_unknown_type_gets_the_nearest() -> None:
    with pytest.raises(UnknownName, match='float'):
        parameter_value('1', 'flaot', expand)
