from __future__ import annotations

import ast
from pathlib import Path

import pytest
from check_terms import (
    ROOT,
    banned_words,
    check,
    check_interface,
    check_launch,
    check_page,
    check_pages,
    check_python,
    parameter_descriptions,
    sentence_fault,
)


@pytest.mark.parametrize(
    ('name', 'words'),
    [
        ('felt_n', ['felt']),
        ('FeltForce', ['felt']),
        ('_on_felt', ['felt']),
        ('LESSON', ['lesson']),
        ('measured_n', []),
        ('comfortable', []),  # a banned word within another one is no word
        ('worthwhile', []),
    ],
)
def test_a_banned_word_is_found_as_a_part_of_a_name_only(name: str, words: list[str]) -> None:
    assert banned_words(name) == words


@pytest.mark.parametrize(
    ('text', 'fault'),
    [
        ('Sets the duration of a window.', ''),
        ("'auto' is the only device on USB.", ''),
        ('The stamp is the time of the first sample.', ''),
        ('sets the duration of a window.', 'it does not start with a capital'),
        ('Sets the duration of a window', 'it does not end with a full stop'),
        ('Sets it.', 'it has fewer than 4 words'),
        ('Length of one window.', 'it has no verb'),
        ('Samples of each channel a second.', 'it has no verb'),
        ('', 'it does not start with a capital'),
    ],
)
def test_a_description_is_a_whole_sentence_or_told_why_not(text: str, fault: str) -> None:
    assert sentence_fault(text) == fault


def test_a_description_may_be_put_together_from_values() -> None:
    tree = ast.parse("class P:\n    arm: str = param('', f'Sets the arm ({NAMES}) that is used.')\n")
    assert [(name, sentence_fault(text)) for name, text, _ in parameter_descriptions(tree)] == [('arm', '')]


def test_names_of_arguments_variables_and_attributes_are_read(tmp_path: Path) -> None:
    path = tmp_path / 'module.py'
    path.write_text('class Pupil:\n    def __init__(self, felt):\n        self.worth = taught = felt\n')
    assert [line.split("'")[1] for line in check_python(path)] == ['Pupil', 'felt', 'worth', 'taught']


def test_each_field_of_a_message_needs_a_sentence_beside_it(tmp_path: Path) -> None:
    path = tmp_path / 'State.msg'
    path.write_text(
        '# What is said here is not checked\n'
        'uint8 IDLE=0     # The explorer is idle.\n'
        'float64 force_n  # force, N\n'
        'string[] units\n'
        '---\n'
    )
    assert [line.split("'")[1] for line in check_interface(path)] == ['force_n', 'units']


def test_each_argument_of_a_launch_file_needs_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / 'arm.launch.xml'
    path.write_text(
        '<launch><arg name="ip" description="address of the arm"/><arg name="rate"/>'
        '<arg name="out" description="Sets the folder of the bag."/></launch>'
    )
    assert [line.split("'")[1] for line in check_launch(path)] == ['ip', 'rate']


def test_faults_of_a_tree_are_named_with_file_and_line(tmp_path: Path) -> None:
    (tmp_path / 'a.py').write_text("class P:\n    length_s: float = param(0.5, 'Length of one window.')\n")
    [fault] = check(tmp_path)
    assert fault.startswith(f"{tmp_path / 'a.py'}:2: the description of 'length_s'")


def test_the_prose_of_a_page_is_read_but_not_its_code_links_and_files(tmp_path: Path) -> None:
    page = tmp_path / 'page.md'
    page.write_text(
        'The class judges windows of `lesson.py`.\n\n    judge = 1  # code\n\n'
        '```python\ntold = 2\n```\n\n[A page](learnt.md) on felt. What it is Worth.\n'
    )
    assert [line.split(': ')[0].rsplit(':')[-1] for line in check_page(page)] == ['1', '9']
    assert [line.split("'")[1] for line in check_page(page)] == ['judges', 'worth']


def test_the_pages_of_the_repository_use_the_terms() -> None:
    assert not check_pages(ROOT)
