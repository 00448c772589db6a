# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bags and labelled slides: recording, reading, replaying, importing, exporting and segmenting.

Data in: MCAP bags, or tables, arrays, sound and data sets of others. Data out: `SlideDataset`, labelled slides with
their signals and conditions. A robot that only records needs this package, `texture_drivers`, `texture_core` and
`texture_msgs`, and neither scikit-learn nor matplotlib.

.. code-block:: python

    from texture_recordings.dataset import SlideDataset
    from texture_recordings.public_sets import import_biotac20

    dataset = SlideDataset.from_bags(import_biotac20('recordings/biotac20', 'bags'), '1-30')
    samples, labels = dataset.to_numpy('signal')  # one array (n_samples, n_channels) per slide

With ROS: `texture record my_bag`, `texture replay my_bag --rate 2`

Limits: a damaged, truncated or foreign bag is refused with a sentence, that of a killed recorder is read up to its last
whole chunk, and none is overwritten. Of foreign files the number of values is read from headers first, and limited.
"""
