# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The executable of every node. It imports nothing else before a signal may come."""

import os
import signal
import sys
from importlib import import_module
from pathlib import Path


def node() -> None:
    """Run the node after which the executable lib/PACKAGE/NODE is named; Ctrl-C during its imports ends it with 0."""
    signal.signal(signal.SIGINT, lambda *_: os._exit(0))
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
    # `texture launch` has blocked them: Python itself would end with a traceback while it starts.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
    package, name = Path(sys.argv[0]).parts[-2:]
    import_module(f'{package}.nodes.{name}').main()
