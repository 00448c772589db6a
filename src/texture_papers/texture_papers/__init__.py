# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Five papers on tactile recognition: their features, learners, recipes, scenes, motions and experiments.

Data in: bags, or simulated slides. Data out: models, and the figures of each paper next to ours. One module per paper
(`roberge`, `rispal`, `jamali`, `kaboli`, `hu`); recipes name its parts as `texture_papers.kaboli:SvmLinear`.

.. code-block:: sh

    texture train kaboli-svm BAG -o model      # a recipe by its name, like one of texture_estimation
    texture experiment jamali --out out

Limits: the experiments run on simulated scenes (`docs/papers.md`). A robot may leave this package out.
"""
