"""The check of docstrings and examples, on small modules and on the repository."""

from __future__ import annotations

from pathlib import Path

import pytest
from check_docstrings import ROOT, check, check_examples, classes_without_example

HEAD = 'from numpy.typing import NDArray\n\n'


def lacks(tmp_path: Path, code: str) -> list[str]:
    """Return what the check says of a module, without place and name."""
    (tmp_path / 'module.py').write_text(HEAD + code)
    return [line.split(' lacks ')[1] for line in check(tmp_path)]


@pytest.mark.parametrize(
    ('code', 'expected'),
    [
        ('def area(a, b):\n    """Return it."""\n', []),
        ('def area(a, b, c):\n    """Set it."""\n', ['Parameters: a; Parameters: b; Parameters: c']),
        (
            'def area(a, b, c) -> float:\n    """Return it.\n\n    Parameters\n    ----------\n    a, b\n        m.\n'
            '    c : float\n        m.\n    """\n',
            ['Returns'],
        ),
        ('def rms(rows: NDArray) -> float:\n    """Return it."""\n', ['Parameters: rows']),
        ('def window(length) -> NDArray:\n    """Return it."""\n', ['Returns']),
        ('def rate(value):\n    """Set it."""\n    raise ValueError(value)\n', ['Raises: ValueError']),
        ('def rate(value):\n    """Set it."""\n    try:\n        f()\n    except OSError:\n        raise\n', []),
        ('def rate(value):\n    """Set it."""\n    def inner():\n        raise ValueError(value)\n', []),
        ('def _rate(a, b, c):\n    """Set it."""\n', []),
        ('class Arm:\n    """One."""\n\n    def move(self, x, y):\n        """Move it."""\n', []),
        (
            'class Arm:\n    """One."""\n\n    def move(self, x, y, z):\n        """Move it."""\n',
            ['Parameters: x; Parameters: y; Parameters: z'],
        ),
        (
            'class Signal:\n    """One."""\n\n    @property\n    def rms(self) -> NDArray:\n        """Rms, (n,)."""\n',
            [],
        ),
    ],
)
def test_a_docstring_lacks_what_name_and_annotations_do_not_say(tmp_path: Path, code: str, expected: list[str]) -> None:
    assert lacks(tmp_path, code) == expected


def test_what_carries_out_a_protocol_is_described_there_and_only_there(tmp_path: Path) -> None:
    code = (
        'class Arm(Protocol):\n    """One."""\n\n    def move(self, x, y, z):\n        """Move it."""\n\n\n'
        'class Ur:\n    """One."""\n\n    def move(self, x, y, z):\n        """Move it."""\n\n\n'
        'class Rails:\n    """One."""\n\n    def move(self, x, y, angle):\n        """Move it."""\n'
    )
    assert lacks(tmp_path, code) == [
        'Parameters: x; Parameters: y; Parameters: z',
        'Parameters: x; Parameters: y; Parameters: angle',
    ]


def test_an_exception_that_the_protocol_names_is_not_named_again(tmp_path: Path) -> None:
    code = (
        'class Arm(Protocol):\n    """One."""\n\n    def move(self):\n        """Move it.\n\n        Raises\n'
        '        ------\n        ArmFault\n            If it stands.\n        """\n\n\n'
        'class Ur:\n    """One."""\n\n    def move(self):\n        """Move it."""\n        raise ArmFault\n\n\n'
        'class Rails:\n    """One."""\n\n    def move(self):\n        """Move it."""\n        raise ValueError\n'
    )
    assert lacks(tmp_path, code) == ['Raises: ValueError']


TABLE = (
    'class Distance(Protocol):\n    """One."""\n\n    def __call__(self, x, y, z, /):\n        """Get.{text}"""\n\n\n'
    'def euclidean(x, y, _z):\n    """Return it."""\n\n\n'
    'def manhattan(x, y, angle):\n    """Return it."""\n\n\n'
    'def unused(x, y, z):\n    """Return it."""\n\n\n'
    "DISTANCES: Mapping[str, Distance] = {{'l2': euclidean, 'l1': manhattan}}\n"
)
SECTIONS = '\n\n        Parameters\n        ----------\n        x, y, z\n            m.\n        '


def test_a_function_that_fills_a_table_is_described_at_the_type_of_the_table(tmp_path: Path) -> None:
    assert lacks(tmp_path, TABLE.format(text=SECTIONS)) == [
        'Parameters: x; Parameters: y; Parameters: angle',
        'Parameters: x; Parameters: y; Parameters: z',
    ]


def test_the_type_of_a_table_describes_its_parameters(tmp_path: Path) -> None:
    assert lacks(tmp_path, TABLE.format(text=''))[0] == 'Parameters: x; Parameters: y; Parameters: z'


def test_a_class_without_a_doctest_is_found_unless_another_one_shows_it(tmp_path: Path) -> None:
    module = tmp_path / 'module.py'
    module.write_text(
        'class Shown:\n    """One.\n\n    >>> Shown(), Used()\n    """\n\n\nclass Used:\n    """One."""\n\n\n'
        'class Named:\n    """Not `Used`."""\n\n\nclass Arm(Protocol):\n    """One."""\n\n\n'
        'class _Own:\n    """One."""\n'
    )
    assert classes_without_example(module) == ['Named']


def test_every_public_class_of_features_estimation_and_recordings_has_an_example() -> None:
    assert not check_examples(ROOT / 'src')
