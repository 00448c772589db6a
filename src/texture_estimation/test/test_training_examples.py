from texture_estimation.gaussians import MAX_EXAMPLES, spread


def test_examples_are_thinned_evenly():
    assert spread(3).tolist() == [0, 1, 2]
    assert len(spread(10 * MAX_EXAMPLES)) == MAX_EXAMPLES
    assert spread(1001, 3).tolist() == [0, 500, 1000]
    assert spread(0).tolist() == []
