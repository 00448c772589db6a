# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recipes, learners and evidence: from features to texture and roughness.

Data in: feature vectors and a model, which is a file with its model card `NAME.json`. Data out: a `TextureEstimate` or
`RoughnessEstimate` after each window, with a calibrated confidence or an interval. Loading a model runs no code.

.. code-block:: python

    from texture_estimation import evidence, model

    accumulator = evidence.EvidenceAccumulator(model.load_model('my-surfaces'))
    estimates = [accumulator.update(vector) for vector in vectors_of_a_slide]

With ROS: `ros2 run texture_estimation classifier --ros-args -p model:=/path/to/my-surfaces.npz`, together with a
`feature_extractor` with `recipe:=/path/to/my-surfaces.json`.

Limits: confidence is calibrated for slides like those of the training (`docs/recipes.md`).
"""
