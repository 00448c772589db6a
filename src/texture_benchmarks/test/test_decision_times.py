import numpy as np

from texture_benchmarks.decision_times import decided_at
from texture_core.estimates import TextureEstimate
from texture_evaluation.metrics import SlideResult


def slide(surface: str, decisions: str, confidences: tuple[float, ...]) -> SlideResult:
    """Return a slide whose windows of 0.5 s every 0.1 s decide letter by letter."""
    estimates = [
        TextureEstimate(0, 'e', label, True, confidences[k], windows=k + 1, evidence_s=0.5 + 0.1 * k)
        for k, label in enumerate(decisions)
    ]
    return SlideResult(surface, list(decisions), estimates)


def test_slides_end_at_a_confidence_or_go_on_to_their_end() -> None:
    growing = [slide('a', 'baa', (0.5, 0.7, 0.9)), slide('b', 'abb', (0.6, 0.6, 0.6))]
    seconds, shares = decided_at(growing, (0.5, 0.7, 0.99))
    np.testing.assert_allclose(seconds, [0.5, 0.65, 0.7])
    np.testing.assert_array_equal(shares, [0.0, 1.0, 1.0])
