"""The style of the pages: short whole sentences in the words of the field."""

from __future__ import annotations

from pathlib import Path

import check_prose
import pytest

LONG = ' '.join(['word'] * 30) + ' is.'


def faults(tmp_path: Path, text: str) -> list[str]:
    page = tmp_path / 'page.md'
    page.write_text(text)
    return list(check_prose.check_page(page))


@pytest.mark.parametrize(
    ('text', 'fault'),
    [
        (LONG, 'a sentence of 31 words'),
        (f'- {LONG}', 'a sentence of 31 words'),
        (f'| a | {LONG} |', 'a sentence of 31 words'),
        ('The finger of the arm.', 'without a verb'),
        ('The slide was taken for oak.', "the phrase 'taken for'"),
        ('The Pupil moves the finger.', "the word 'pupil'"),
    ],
)
def test_a_fault_is_named(tmp_path: Path, text: str, fault: str) -> None:
    [found] = faults(tmp_path, text)
    assert fault in found


@pytest.mark.parametrize(
    'text',
    [
        'The finger slides over the oak.',
        f'{LONG[:-4]}'.replace('word word word', 'The finger slides.', 1) + '\n\nIt stops.',
        '# The oak of the finger.',
        'Write `' + 'word ' * 40 + '` and wait.',
        '```\n' + LONG + ' the finger felt\n```',
        '<!-- ' + LONG + ' -->',
    ],
)
def test_short_whole_sentences_and_code_pass(tmp_path: Path, text: str) -> None:
    assert faults(tmp_path, text) == []


def test_the_line_of_a_fault_is_that_of_the_page(tmp_path: Path) -> None:
    [found] = faults(tmp_path, f'# Page\n\n```\ncode\ncode\n```\n\n{LONG}\n')
    assert ':8:' in found


def test_all_converted_pages_keep_to_the_style() -> None:
    assert [fault for page in check_prose.pages() for fault in check_prose.check_page(page)] == []
