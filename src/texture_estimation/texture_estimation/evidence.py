# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Accumulation of evidence about a surface over the windows of a slide."""

from __future__ import annotations

import math

import numpy as np

from texture_core.types import NANOSECONDS, Array, FeatureVector, Rejection, TextureEstimate
from texture_estimation.acceptance import SlideDistance, margin_of
from texture_estimation.domain import LOUDER, OUTSIDE
from texture_estimation.evidence_rules import GroupedEvidence, followed
from texture_estimation.learners.learner import trust
from texture_estimation.model import INVERSE_TEMPERATURE, TextureModel
from texture_features.feature_set import RunningConditions, fingerprint_difference
from texture_features.windows import WindowParams

# --------------------
# The sentence of a final estimate that no window of the slide could be used for.


def no_window(windows: WindowParams) -> str:
    """Return why a slide ended without a window, how long it must be, and what to do."""
    skip_s, length_s = windows.skip_s, windows.length_s
    needed = (
        f'{skip_s + length_s:g} s, the first {skip_s:g} s and a window' if skip_s else f'the {length_s:g} s of a window'
    )
    return (
        f'no window could be used: the slide was shorter than {needed}, or its samples were lost; '
        'slide longer or more slowly'
    )


NO_MODEL = "no model is loaded; set the parameter 'model' of the classifier to the path of a trained one"


def single_decisions(model: TextureModel, values: Array) -> list[str]:
    """Return what each window of a slide decides alone or, where windows vote together, what each complete group does.

    A slide that is shorter than a group gives one decision.
    """
    rule = model.recipe.evidence
    if not rule.group or not len(values):
        return model.decide(values) if len(values) else []
    means, windows = followed(rule, rule.window_evidence(model.predict_log_proba(values)), 1.0)
    complete = slice(rule.group - 1, None, rule.group) if len(values) >= rule.group else slice(-1, None)
    return model.best_labels(rule.log_posterior(means[complete], windows[complete, None], tempering_exponent=1.0))


class EvidenceAccumulator:
    """Accumulate the window predictions of one slide; the same code runs live and offline.

    A new exploration id, or a vector after the `last` one, starts a new slide. Each estimate shows whether the label is
    rejected, and why; it is decided only while it is not. An exploration under conditions that were not trained is
    rejected, and the message states which condition it is. Equally probable labels give no label: unclassified.
    No confidence is above what the slides held out of the training can show.
    """

    def __init__(self, model: TextureModel | None) -> None:
        self.model = model
        self.refused = 0
        self.not_finite = 0
        self._over = True
        self._exploration_id = self._message = ''

    def update(self, vector: FeatureVector) -> TextureEstimate:
        """Return the estimate after one more window, or the final one after the `last` vector."""
        if self._over or vector.exploration_id != self._exploration_id:
            self._start(vector.exploration_id)
        if vector.last:
            self._over = True
            if vector.skipped and not self._message:
                left_out = f'{vector.skipped} of {vector.skipped + self._windows} windows were left out'
                self._message = f'{left_out}, as samples were lost or not finite'
        elif self.model is not None:
            self._predict(vector, self.model)
        return self._estimate(vector)

    def _start(self, exploration_id: str) -> None:
        self._exploration_id = exploration_id
        self._over = False
        self._windows = self._evidence_ns = self._window_ns = self._end_ns = 0
        self._misfit = False  # features of another set came
        self._message = '' if self.model else NO_MODEL
        if (model := self.model) is not None:
            self._evidence = GroupedEvidence(model.recipe.evidence, len(model.labels))
            distance = model.active_acceptance.distance
            self._distance = SlideDistance(distance) if distance else None
        self._conditions = RunningConditions()
        self._deviation = ''  # of these conditions from those of the training

    def _predict(self, vector: FeatureVector, model: TextureModel) -> None:
        if vector.feature_set != model.feature_set:
            self.refused += 1
            self._misfit = True
            self._message = (
                f"model '{model.name}' does not fit: {fingerprint_difference(vector.feature_set, model.feature_set)}"
            )
            return
        finite = np.isfinite(vector.values)
        if not finite.all():
            self.not_finite += 1
            bad = vector.names[int(finite.argmin())]
            self._message = f"a window was left out: its feature '{bad}' is not finite"
            return
        self._conditions.update(vector)
        self._deviation = model.active_acceptance.domain.deviation(self._conditions)
        scores, compared = model.predict_and_compare(vector.values)
        self._windows += 1
        self._window_ns = round(vector.window_s * NANOSECONDS)
        end = vector.start_ns + self._window_ns
        self._evidence_ns += max(0, end - max(vector.start_ns, self._end_ns))
        self._end_ns = max(end, self._end_ns)
        # The effective number of windows follows from the sliding time that they cover, whatever their weights.
        self._effective_windows = self._evidence_ns / self._window_ns
        evidence = model.recipe.evidence.window_evidence(scores)
        self._evidence.add(evidence, self._effective_windows, float(trust(model.predictor, vector.values)))
        if self._distance is not None:
            self._distance.add(compared, self._effective_windows)

    def _estimate(self, vector: FeatureVector) -> TextureEstimate:
        model, final = self.model, vector.last
        if model is None or not self._windows:
            return TextureEstimate(
                stamp_ns=vector.start_ns,
                exploration_id=vector.exploration_id,
                frame_id=vector.frame_id,
                rejection=Rejection.NO_MODEL if model is None or self._misfit else Rejection.TOO_LITTLE_EVIDENCE,
                final=final,
                model=model.name if model else '',
                message=self._message or (no_window(model.recipe.feature_set.windows) if model and final else ''),
            )
        mean = self._evidence.mean
        probabilities = model.recipe.evidence.posterior(mean, self._evidence.windows, model.tempering_exponent)
        listed = probabilities.tolist()
        confidence = max(listed)
        best, single = listed.index(confidence), listed.count(confidence) == 1
        acceptance = model.acceptance_of(best)
        second, first = sorted(mean.tolist())[-2:]  # of some tens of labels quicker than a partition
        if best >= model.n_trained and not model.learns_online:  # tempered for the confidence alone
            second, first = second / INVERSE_TEMPERATURE, first / INVERSE_TEMPERATURE
        margin = margin_of(first, second)
        distance = self._distance.to(best) if self._distance else math.inf
        rejection, decided = acceptance.assess(margin, distance, self._effective_windows)
        deviation = self._deviation
        if not deviation and model.labels[best] in acceptance.domain.quiet_labels:
            deviation = f'{OUTSIDE}: slides of {model.labels[best]} are as quiet as the sensor at rest; {LOUDER}'
        if deviation:
            rejection = Rejection.OUTSIDE_TRAINING
        elif not single and rejection is Rejection.NONE:
            rejection = Rejection.AMBIGUOUS
        reported = tuple(acceptance.limited(listed))
        members, reasons = list[int](), [deviation, self._message]
        if final and not deviation:
            members = acceptance.members(probabilities, self._effective_windows)
            too_little = rejection is Rejection.TOO_LITTLE_TRAINING
            reasons.append(acceptance.reason if too_little else acceptance.decided_reason)
            reasons.append('' if rejection is Rejection.NONE else acceptance.domain.reach_reason)
        return TextureEstimate(
            stamp_ns=self._end_ns,
            exploration_id=vector.exploration_id,
            frame_id=vector.frame_id,
            label=model.labels[best] if single else '',
            rejection=rejection,
            confidence=max(reported),
            probabilities=reported,
            decided=decided and rejection is Rejection.NONE,
            prediction_set=tuple(model.labels[number] for number in members),
            windows=self._windows,
            evidence_s=self._evidence_ns / NANOSECONDS,
            final=final,
            model=model.name,
            message='; '.join(filter(None, reasons)),
        )
