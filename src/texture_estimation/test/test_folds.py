import numpy as np

from texture_estimation.learners.folds import divide


def test_no_slide_is_on_both_sides_and_parts_are_stretches_of_time():
    codes = np.repeat([0, 1], 30)
    groups = np.repeat(np.arange(20), 3)
    parts, note = divide(codes, groups, 5)
    for group in range(20):
        assert len(set(parts[groups == group])) == 1
    for code in (0, 1):
        assert (np.diff(parts[codes == code]) >= 0).all()
        assert set(parts[codes == code]) == set(range(5))
    assert 'slides' in note


def test_every_label_is_always_trained_on():
    codes = np.repeat([0, 1], [4, 30])
    groups = np.concatenate([[0, 0, 1, 1], np.repeat(np.arange(2, 12), 3)])
    parts, _ = divide(codes, groups, 5)
    for part in range(5):
        assert set(codes[parts != part]) == {0, 1}


def test_a_label_with_one_slide_is_divided_by_windows_and_the_note_says_so():
    parts, note = divide(np.repeat([0, 1], 4), np.repeat([0, 1], 4), 2)
    assert parts.tolist() == [0, 0, 1, 1, 0, 0, 1, 1]
    assert 'single slide' in note


def test_a_label_with_one_window_cannot_be_divided():
    assert divide(np.array([0, 0, 1]), np.array([0, 1, 2]), 2) is None
