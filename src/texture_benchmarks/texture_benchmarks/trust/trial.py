"""Slides under a disturbance, and whether they end right, unknown or with a wrong label taken for known."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from texture_benchmarks.recipes.trial import at_rate
from texture_benchmarks.robustness.degradations import DEGRADATIONS
from texture_core.arrays import Array
from texture_core.features import FeatureVector
from texture_core.signal import TactileSignal
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import TextureModel
from texture_evaluation.metrics import SlideResult
from texture_features.augmentation.disturbances import smooth_response
from texture_recordings.labelled_slide import LabelledSlide
from texture_recordings.slide_dataset import SlideDataset

VIBRATION = 'signal'
FINGER_SEED = 7  # the same other finger for all slides
UNDISTURBED = 'undisturbed'
# (samples (n, n_channels), rate in Hz, strength, random, whether it is the vibration) -> samples
Change = Callable[[Array, float, float, np.random.Generator, bool], Array]


def _shared(name: str) -> Change:
    """Return a degradation of both inputs."""
    change = DEGRADATIONS[name].change
    return lambda samples, rate_hz, strength, rng, _vibration: change(samples, rate_hz, strength, rng)


def _of_vibration(name: str) -> Change:
    """Return a degradation of the vibration alone."""
    change = DEGRADATIONS[name].change
    return lambda samples, rate_hz, strength, rng, vibration: (
        change(samples, rate_hz, strength, rng) if vibration else samples
    )


def _other_finger(
    samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator, vibration: bool
) -> Array:
    """Filter the vibration by one smooth random response (dB); other gains and offsets of the slow channels."""
    rng = np.random.default_rng([FINGER_SEED, round(1000 * strength), vibration])
    mean: Array = samples.mean(axis=0)
    deviation = samples - mean
    if vibration:
        response = smooth_response(len(samples) // 2 + 1, strength, rng)
        filtered: Array = np.fft.irfft(np.fft.rfft(deviation, axis=0) * response[:, None], len(samples), axis=0)
        return mean + filtered
    gains = np.exp(0.05 * strength * rng.standard_normal(samples.shape[1]))
    offsets = 3.0 * strength * rng.standard_normal(samples.shape[1])
    changed: Array = mean + gains * deviation + offsets
    return changed


@dataclass(frozen=True)
class DisturbanceSweep:
    """One disturbance at several strengths.

    Parameters
    ----------
    change
        What is done to the samples.
    strengths
        How strongly.
    form
        Name of the disturbance at a strength.
    percent
        Whether the name gives the strength in percent.
    """

    change: Change
    strengths: Sequence[float]
    form: str
    percent: bool = False

    def name(self, strength: float) -> str:
        """Return the name of the disturbance at this strength."""
        return self.form.format(100.0 * strength if self.percent else strength)

    @property
    def title(self) -> str:
        """Name of the disturbance, with an ellipsis in place of its strength."""
        return self.form.replace('{:g}', '…')

    def tick(self, strength: float) -> str:
        """Return the strength as a number, in percent where the name gives it so."""
        return f'{100.0 * strength if self.percent else strength:g}'


ROWS: Mapping[str, DisturbanceSweep] = {
    'gain': DisturbanceSweep(_of_vibration('lower gain'), (0.5, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 2.0), 'gain × {:g}'),
    'white noise': DisturbanceSweep(
        _shared('white noise'), (0.003, 0.01, 0.03, 0.1), 'white noise {:g} % of the rms', percent=True
    ),
    'speed': DisturbanceSweep(
        _shared('slower than trained'), (0.4, 0.7, 0.9, 0.95, 1.05, 1.1, 1.4, 2.0), 'speed × {:g}'
    ),
    'another finger': DisturbanceSweep(_other_finger, (1.0, 2.0, 4.0), 'another finger, {:g} dB'),
    'wear': DisturbanceSweep(_of_vibration('wear'), (800.0, 300.0), 'low-pass {:g} Hz'),
    'offset drift': DisturbanceSweep(_shared('offset drift'), (0.1, 1.0, 10.0), 'drift {:g} rms/s'),
    'lost samples': DisturbanceSweep(
        _of_vibration('lost samples'), (0.001, 0.005, 0.01), 'lost samples {:g} %', percent=True
    ),
    'hidden losses': DisturbanceSweep(
        _of_vibration('losses hidden'), (0.003, 0.01, 0.03, 0.1), 'hidden losses {:g} %', percent=True
    ),
    'clipped': DisturbanceSweep(_of_vibration('clipping'), (3.0, 2.0, 1.0), 'clipped at {:g} rms'),
}


@dataclass(frozen=True)
class Outcome:
    """How the slides of one cell ended.

    Parameters
    ----------
    slides
        How many.
    early_right, early_wrong
        Slides with a right and with a wrong label at the first certain estimate; the others were never certain.
    final_right, final_wrong
        Slides with a right and with a wrong label that were taken for known at the end; the others were rejected.
    mean_s
        Mean sliding time until the first certain estimate, or to the end.
    label_right
        Slides with the right label at the end, whether they were taken for known or not.
    """

    slides: int
    early_right: int
    early_wrong: int
    final_right: int
    final_wrong: int
    mean_s: float
    label_right: int

    @property
    def worst_wrong(self) -> float:
        """The larger share of slides that were wrong and known: at the first certain estimate, or at the end."""
        return max(self.early_wrong, self.final_wrong) / self.slides

    @classmethod
    def of(cls, results: Sequence[SlideResult]) -> Outcome:
        """Return the outcome of slides; one without a window counts as rejected."""
        measured = [result for result in results if result.estimates]
        first = [(next((e for e in result.estimates if e.decided), None), result) for result in measured]
        early = [estimate.label == result.surface for estimate, result in first if estimate is not None]
        final = [result.end.label == result.surface for result in measured if result.end.known]
        times = [(estimate or result.estimates[-1]).evidence_s for estimate, result in first]
        return cls(
            slides=len(results),
            early_right=sum(early),
            early_wrong=len(early) - sum(early),
            final_right=sum(final),
            final_wrong=len(final) - sum(final),
            mean_s=float(np.mean(times)) if times else math.nan,
            label_right=sum(result.end.label == result.surface for result in measured),
        )


def disturbed(item: LabelledSlide, row: DisturbanceSweep, strength: float, rng: np.random.Generator) -> LabelledSlide:
    """Return a slide under a disturbance of this strength.

    Parameters
    ----------
    item
        Slide with its signals.
    row
        Kind of the disturbance.
    strength
        In the unit of the disturbance.
    rng
        Random numbers of the disturbance.

    Returns
    -------
    LabelledSlide
    """
    signals = {topic: _changed(item, topic, row, strength, rng) for topic in item.signals}
    return dataclasses.replace(item, signals=signals)


def evaluate_slides(model: TextureModel, slides: Sequence[LabelledSlide]) -> list[SlideResult]:
    """Return what a model says of slides, window by window."""
    extracted = SlideDataset(tuple(slides)).vectors(model.recipe.feature_set)
    return [evaluate_vectors(model, slide.surface, vectors) for slide, vectors in extracted]


def evaluate_vectors(model: TextureModel, surface: str, vectors: Sequence[FeatureVector]) -> SlideResult:
    """Return what a model says of the windows of one slide.

    Parameters
    ----------
    model
        Trained model.
    surface
        True label of the slide.
    vectors
        Its windows and its end.

    Returns
    -------
    SlideResult
    """
    evidence = EvidenceAccumulator(model)
    estimates = [evidence.update(vector) for vector in vectors]
    alone = model.decide(np.stack([vector.values for vector in vectors])) if vectors else []
    return SlideResult(surface, alone, [estimate for estimate in estimates if estimate.windows])


def _changed(
    item: LabelledSlide, topic: str, row: DisturbanceSweep, strength: float, rng: np.random.Generator
) -> list[TactileSignal]:
    batches = item.signals[topic]
    whole = at_rate(item, topic, batches[0].sampling_rate_hz).signals[topic]
    return [
        dataclasses.replace(
            run,
            samples=row.change(
                run.samples.astype(np.float64), run.sampling_rate_hz, strength, rng, topic == VIBRATION
            ).astype(np.float32),
        )
        for run in whole
    ]
