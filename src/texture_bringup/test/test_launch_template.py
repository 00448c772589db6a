import pytest

from texture_bringup.launcher import expand, parse
from texture_core.errors import InvalidLaunch


def shown(name, arguments):
    return f'<{name}:{"|".join(arguments)}>'


@pytest.mark.parametrize(
    ('text', 'expanded'),
    [
        ('', ''),
        ('plain $5 (text)', 'plain $5 (text)'),
        ('a $(var x) b', 'a <var:x> b'),
        ('$(env XDG /tmp)/finger', '<env:XDG|/tmp>/finger'),
        ('$(env $(var name) "a b")', '<env:<var:name>|a b>'),
        ("$(env X '')", '<env:X|>'),
        (r'\$(var x)', '$(var x)'),
    ],
)
def test_calls_are_expanded_innermost_first_and_all_else_stays(text, expanded) -> None:
    assert expand(parse(text), shown) == expanded


@pytest.mark.parametrize('text', ['$(var x', '$()', '$(var  x)', '$(var "x)', '$(5)'])
def test_a_call_that_is_not_well_formed_is_refused_with_the_form(text) -> None:
    with pytest.raises(InvalidLaunch, match='write'):
        parse(text)
