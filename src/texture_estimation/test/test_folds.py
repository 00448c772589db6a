import numpy as np

from texture_estimation.learners.learner import assign_folds


def test_no_slide_is_on_both_sides_and_parts_are_stretches_of_time():
    codes = np.repeat([0, 1], 30)
    groups = np.repeat(np.arange(20), 3)
    parameters, note = assign_folds(codes, groups, 5)
    for group in range(20):
        assert len(set(parameters[groups == group])) == 1
    for code in (0, 1):
        assert (np.diff(parameters[codes == code]) >= 0).all()
        assert set(parameters[codes == code]) == set(range(5))
    assert 'slides' in note


def test_every_label_is_always_trained_on():
    codes = np.repeat([0, 1], [4, 30])
    groups = np.concatenate([[0, 0, 1, 1], np.repeat(np.arange(2, 12), 3)])
    parameters, _ = assign_folds(codes, groups, 5)
    for part in range(5):
        assert set(codes[parameters != part]) == {0, 1}


def test_a_label_with_one_slide_is_divided_by_windows_and_the_note_says_so():
    parameters, note = assign_folds(np.repeat([0, 1], 4), np.repeat([0, 1], 4), 2)
    assert parameters.tolist() == [0, 0, 1, 1, 0, 0, 1, 1]
    assert 'single slide' in note


def test_a_label_with_one_window_cannot_be_divided():
    assert assign_folds(np.array([0, 0, 1]), np.array([0, 1, 2]), 2) is None
