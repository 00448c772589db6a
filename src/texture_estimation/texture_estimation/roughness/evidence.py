"""The grade of a surface, and how sure it is, growing window by window while the finger slides."""

from __future__ import annotations

import math

from texture_core.estimates import RoughnessEstimate
from texture_core.features import FeatureVector
from texture_core.signal import NANOSECONDS
from texture_estimation.fingerprint import fingerprint_difference
from texture_estimation.no_window import no_window
from texture_estimation.roughness.model import NORMAL_90, RoughnessModel
from texture_estimation.roughness.regressor import ROUGH, SMOOTH

NO_MODEL = "no model is loaded; set the parameter 'model' of the roughness_estimator to the path of a trained one"
SILENT = 'no grade: the surface resembles no training surface'
# The scatter of the windows of a texture, known from the training, counts as so many windows.
PRIOR_WINDOWS = 4.0


class RoughnessAccumulator:
    """Join the grades of the windows of one slide; the same code on the robot and on recordings.

    A new exploration id, or a vector after the `last` one, starts again.

    Parameters
    ----------
    model
        What grades each window; None answers the end of every slide with a sentence that no model is loaded.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.roughness.roughness_recipe import RoughnessRecipe
    >>> from texture_estimation.roughness.training import train_grades
    >>> from texture_estimation.roughness.grades import Grades
    >>> from texture_features.labelled_features import LabelledFeatures
    >>> inputs = {'signal': {'features': ['mean']}}
    >>> recipe = RoughnessRecipe.from_mapping({'inputs': inputs, 'regressor': 'gaussian_process'}, 'tiny')
    >>> labels = np.repeat(['silk', 'felt', 'cork', 'jute'], 10)
    >>> values = np.repeat([1.0, 2.0, 3.0, 4.0], 10)[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 1))
    >>> examples = LabelledFeatures(values, labels, np.char.add(labels, '/1'), ('signal/mean',), 'a1', 0.5, 0.1)
    >>> model = train_grades(recipe, examples, Grades({'silk': 1.0, 'felt': 2.0, 'cork': 3.0, 'jute': 4.0}))
    >>> grader = RoughnessAccumulator(model)
    >>> window = FeatureVector(0, 'slide', 0.5, 0.1, ('signal/mean',), np.array([2.0]), feature_set='a1')
    >>> abs(grader.update(window).grade - 2.0) < 0.5
    True
    """

    def __init__(self, model: RoughnessModel | None) -> None:
        self.model = model
        self.refused = 0  # vectors of another fingerprint
        self.unusable = 0  # windows without contact, with skids or with values that are not finite
        self.silent = 0  # windows to which the regressor gave no grade
        self._over = True
        self._final = False
        self._exploration_id = ''

    def update(self, vector: FeatureVector) -> RoughnessEstimate | None:
        """Return the estimate after one more window, or the final one; None after that."""
        if self._over or vector.exploration_id != self._exploration_id:
            self._start(vector.exploration_id)
        self._over = vector.last
        if self._final:
            return None
        if self.model is not None and not vector.last:
            self._take(vector, self.model)
        estimate = self._estimate(vector)
        self._final = estimate.final
        return estimate

    def _start(self, exploration_id: str) -> None:
        self._exploration_id = exploration_id
        self._final = False
        self._windows = 0
        self._sum = self._sum_squares = self._sum_variances = 0.0
        self._evidence_ns = self._window_ns = self._end_ns = 0
        self._message = '' if self.model else NO_MODEL

    def _take(self, vector: FeatureVector, model: RoughnessModel) -> None:
        if vector.feature_set != model.feature_set:
            self.refused += 1
            self._message = (
                f"model '{model.name}' does not fit: {fingerprint_difference(vector.feature_set, model.feature_set)}"
            )
            return
        refusal = model.checks.refusal(vector)
        if refusal:
            self.unusable += 1
            self._message = f'a window was left out: {refusal}'
            return
        grade, std = (float(number) for number in model.grade(vector.values))
        if math.isnan(grade):
            self.silent += 1
            self._message = SILENT
            return
        self._windows += 1
        self._sum += grade
        self._sum_squares += grade * grade
        self._sum_variances += float(model.calibration.shared_variance(std))
        self._window_ns = round(vector.window_s * NANOSECONDS)
        end = vector.start_ns + self._window_ns
        self._evidence_ns += max(0, end - max(vector.start_ns, self._end_ns))
        self._end_ns = max(end, self._end_ns)

    def _estimate(self, vector: FeatureVector) -> RoughnessEstimate:
        model = self.model
        if model is None or not self._windows:
            return RoughnessEstimate(
                stamp_ns=vector.start_ns,
                exploration_id=vector.exploration_id,
                frame_id=vector.frame_id,
                final=vector.last,
                model=model.name if model else '',
                message=self._message or (no_window(model.recipe.feature_set.windows) if model and vector.last else ''),
            )
        shared, scatter = self._variances(model)
        std = math.sqrt(shared + scatter)
        to_gain = NORMAL_90 * (std - math.sqrt(shared))
        params = model.recipe.evidence
        narrow = self._windows >= params.min_windows and to_gain < params.min_narrowing_grades
        return RoughnessEstimate(
            stamp_ns=self._end_ns,
            exploration_id=vector.exploration_id,
            frame_id=vector.frame_id,
            valid=True,
            grade=min(max(self._sum / self._windows, SMOOTH), ROUGH),
            grade_std=std,
            windows=self._windows,
            evidence_s=self._evidence_ns / NANOSECONDS,
            final=vector.last or narrow,
            model=model.name,
            message=self._message,
        )

    def _variances(self, model: RoughnessModel) -> tuple[float, float]:
        """Return the variance that more sliding does not lessen, and that of the mean of the windows so far."""
        count = self._windows
        around = max(0.0, self._sum_squares - self._sum * self._sum / count)
        known = PRIOR_WINDOWS * model.calibration.within_std**2
        scatter = (known + around) / (PRIOR_WINDOWS + count - 1.0)
        # Windows that overlap contribute the sliding time that they cover together.
        return self._sum_variances / count, scatter * self._window_ns / self._evidence_ns
