# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Benchmarks, one file per study that feeds a page, and endurance runs with injected faults.

Data in: public recordings (`--data DIR`, or the folder that `TEXTURE_DATA` names) or simulated slides. Data out:
figures as JSON and charts as PNG, in `docs/charts` unless `--out` says otherwise.

.. code-block:: sh

    texture benchmark latency --out out      # `texture benchmark --help` lists the studies
    texture endurance --duration 600 --out days

Limits: not deployed on a robot; computing times hold for one machine (`docs/benchmarks.md`).
"""
