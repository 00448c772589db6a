"""Names for array types; the shape stands in the docstring of each function."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Samples = NDArray[np.float64]  # (..., n_samples, n_channels)
AnyArray = NDArray[Any]
