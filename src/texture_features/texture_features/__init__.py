# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Windows of a tactile signal and the features that describe them.

Data in: `TactileSignal`s of any rate and number of channels, and `ExplorationState`s with the times of sliding.
Data out: a `FeatureVector` per window, with names such as `signal/mean_log_bands/12/dynamic` (input, feature, value,
channel). The node and the offline functions give the same numbers to the last bit.

.. code-block:: python

    from texture_features.feature_set import FeatureSet
    from texture_features.windows import cut_recording

    features = FeatureSet.load('default')  # the name or path of a recipe
    vectors = features.extract_many(cut_recording({'signal': batches}, states, features.windows))

With ROS: `ros2 run texture_features feature_extractor --ros-args -p recipe:=default`

Limits: signals and states may arrive with a difference of at most 10 s.
"""
