# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Check a finger by a slide over one reference plate: store, compare, correct."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from texture_core.config import write_json
from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, ExplorationRequest
from texture_estimation.model import load_model, model_stem
from texture_estimation.training import DAY_SUFFIX, adapted
from texture_evaluation.train import slide_digest, training_examples
from texture_features.correction import (
    CORRECTION,
    GAIN_DB,
    RESPONSE_DB,
    SLIDE_NUMBERS,
    Correction,
    InputComparison,
    InputStatistics,
    compare,
    file_next_to,
    read_correction,
    write_reference,
)
from texture_features.windows import WindowBatch
from texture_recordings.dataset import SlideDataset
from texture_recordings.slides import LabelledSlide, SlideSamples

# An arm without a new command for longer stops and sets off with a jerk, which no finger would show otherwise.
PAUSE_S = 0.1
UNMEASURED = 'noise and drift were not measured, as too little was recorded before the touch'


def statistics_of(
    slide: LabelledSlide, topics: Iterable[str], correction: Correction | None = None, *, weak: bool = False
) -> dict[str, InputStatistics]:
    """Return what a slide over the reference plate shows of each input, as the correction of a model leaves it.

    A `weak` one may be hardly above the rest: that is a finding, but no reference, and nothing is corrected by it.
    """
    _check_steady(slide)
    found = {}
    for topic in topics:
        batches = slide.signals.get(topic, ())
        if any(after.first_sample != before.next_sample for before, after in pairwise(batches)):
            raise InvalidData(
                f"samples of '{topic}' were lost in the slide over the plate; stop other programs on the computer, and "
                'check again'
            )
        one, rest = SlideSamples.of(slide, topic), slide.at_rest(topic)
        samples = one.samples
        if correction is not None:
            samples = correction.apply(topic, WindowBatch(samples, one.rate_hz)).samples
            rest = correction.apply(topic, WindowBatch(rest, one.rate_hz)).samples if len(rest) else rest
        found[topic] = InputStatistics.of(samples, rest, one.rate_hz, one.channels, batches[0].sensor, weak=weak)
    return found


def _check_steady(slide: LabelledSlide) -> None:
    """Raise InvalidData if the finger paused after its first move: late states, or several at one place."""
    moves = [one for last, one in pairwise(slide.sliding) if (one.x_m, one.y_m) != (last.x_m, last.y_m)]
    steps_s = np.diff([one.stamp_ns for one in moves]) / NANOSECONDS
    if steps_s.max(initial=0.0) > PAUSE_S:
        raise InvalidData(
            f'the arm paused for {1e3 * steps_s.max():.0f} ms in the slide over the plate ({1e3 * PAUSE_S:.0f} ms are '
            f'allowed), so it shows nothing about the finger; stop other programs on the computer, or raise the '
            f'rate of its pose ({1 / np.median(steps_s):.2g} Hz; above {1 / PAUSE_S:g} Hz is needed), and repeat'
        )


def store_reference(
    model: str | Path,
    topics: Iterable[str],
    slides: Sequence[LabelledSlide],
    request: ExplorationRequest,
) -> str:
    """Store the last slide over the plate as that of the finger of the training, once the one before shows the same."""
    if len(slides) < 2:
        raise InvalidData('one slide over the plate does not show repeatability; record two, and store again')
    before, last = (statistics_of(slide, topics) for slide in slides[-2:])
    if faults := _faults({topic: compare(before[topic], last[topic]) for topic in last}):
        raise InvalidData(
            f'nothing is stored, for two slides over the plate differ: {"; ".join(faults)}. Clean and fasten the '
            'finger, stop other programs on the computer, and store again'
        )
    made = {name: getattr(request, name) for name in SLIDE_NUMBERS}
    path = write_reference(model, last, made)
    unknown = '' if all(np.isfinite(one.rest_rms).all() for one in last.values()) else f'; {UNMEASURED}'
    return f"the slide is stored as the reference of the finger, '{path}'{unknown}"


def check_finger(
    model: str | Path,
    topics: Iterable[str],
    reference: Mapping[str, InputStatistics],
    slide: LabelledSlide,
    *,
    correct: bool = False,
) -> tuple[bool, str]:
    """Compare the finger with that of the training by a slide over the plate; return whether it is, and a sentence.

    It is compared as the nodes see it: through the correction of the model, if there is one.
    """
    today = statistics_of(slide, topics, weak=not correct)
    if missing := sorted(set(today) - set(reference)):
        raise InvalidData(f"the reference holds no '{missing[0]}'; store it again by --store")
    found = {topic: compare(reference[topic], one) for topic, one in today.items()}
    faults = _faults(found)
    path, correction = file_next_to(model, CORRECTION), read_correction(model)
    # Without the option the nodes keep the correction, so what it leaves is what counts.
    if correction is not None and not correct:
        seen = statistics_of(slide, topics, correction, weak=True)
        left = {topic: compare(reference[topic], one) for topic, one in seen.items()}
        if not _faults(left):
            return True, f"with its correction, '{path}', {_claim(left)}"
        if not faults:
            return False, f"the finger is as trained, but '{path}' corrects another one; remove that by --correct"
        return False, (
            f"the finger is not as trained, also with its correction, '{path}': {'; '.join(_faults(left))}. Correct it "
            'anew by --correct; if that does not help, train with this finger'
        )
    if not faults:
        # A correction would falsify a finger that is as trained.
        if correction is not None:
            path.unlink()
        return True, _claim(found) + ('; its correction is removed' if correction is not None else '')
    sentence = f'the finger is not as trained: {"; ".join(faults)}'
    if not correct:
        return False, f'{sentence}. Check that this is the reference plate; clean or replace the skin, or use --correct'
    write_json(Correction.of(found).as_mapping(), path)
    return False, f"{sentence}. The model is corrected, '{path}': start the nodes again with its model card as recipe"


def adapt_to_today(model: str | Path, bags: Sequence[str | Path], today: Sequence[str | Path]) -> str:
    """Save MODEL-today, adapted by the labelled slides of today, and return in a sentence what it is."""
    trained = load_model(model)
    feature_set, out = trained.recipe.feature_set, f'{model_stem(model)}{DAY_SUFFIX}'
    shots = SlideDataset.from_bags(today, topics=feature_set.topics)
    slides = SlideDataset.from_bags(bags, topics=feature_set.topics)
    known = {*map(slide_digest, slides), *trained.training.get('slide_digests', ())}
    if again := [slide.name for slide in shots if slide_digest(slide) in known]:
        raise InvalidData(
            f"{len(again)} of the {len(shots)} slides of today are slides of the training, the first '{again[0]}'; "
            'give bags that hold slides of today alone'
        )
    examples = training_examples(trained.recipe, slides)
    today_model = adapted(trained, examples, shots.features(feature_set))
    today_model.save(out)
    return (
        f"'{out}' is adapted to {len(shots)} slides of today; it rejects every label: {today_model.acceptance.reason}"
    )


def _faults(found: Mapping[str, InputComparison]) -> list[str]:
    return [f'{topic}: {fault}' for topic, one in found.items() for fault in one.faults]


def _claim(found: Mapping[str, InputComparison]) -> str:
    """Return that a finger is as trained, as far as it was measured, with the numbers."""
    known = all(one.rest_is_known for one in found.values())
    claim = 'the finger is as trained' if known else f'gain and response are as trained, {UNMEASURED}'
    numbers = ', '.join(
        f'{topic} gain {np.median(one.gain_db):+.1f} dB (±{GAIN_DB:g} dB is allowed), response within '
        f'{np.abs(one.response_db).max():.1f} dB and {one.uneven_db:.1f} dB rms ({RESPONSE_DB:g} dB rms is allowed)'
        + (f', noise × {one.noise_ratio:.1f}, drift {one.drift:.1f} rms' if one.rest_is_known else '')
        for topic, one in found.items()
    )
    return f'{claim}: {numbers}'
