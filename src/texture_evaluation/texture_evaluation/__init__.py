# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Training on labelled bags, evaluation, cross-validation, metrics, charts and panels of people.

Data in: bags of labelled slides and a recipe. Data out: a model, or figures as JSON: accuracy of windows and slides
over sliding time, calibration error, confusion and latency. Nothing here needs ROS.

.. code-block:: python

    from texture_evaluation.evaluate import evaluate
    from texture_evaluation.train import train_from_bags

    model = train_from_bags('default', bags, slides='1-30', out='models/biotac')
    print(evaluate(model, bags, slides='31-40').as_json()['accuracy_at_s'])

Limits: a figure holds for the shift that its split crosses (`docs/generalisation.md`).
"""
