# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Common parts of all packages: data types, parameters, catalogues, errors, framing of serial lines and ROS glue.

Data: frozen dataclasses, which are checked when they are made. Times are integers in ns and quantities are SI.
Nothing reads a clock. Only the module `ros` needs ROS.

.. code-block:: python

    from texture_core.config import find, param
    from texture_core.types import TactileSignal, lost_samples

    lost = lost_samples(batches)  # batches: TactileSignals of one stream, in order
    feature = find({'hjorth': hjorth}, 'hjorth', 'feature')  # the error for a wrong name gives the nearest one

Limits: a parameter is declared once, as a `param` field; YAML, ROS and the reference read it there.
"""
