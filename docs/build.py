# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Build the site: `.venv/bin/ros-run python docs/build.py [FOLDER]`; then open FOLDER/index.html (out/site)."""

from __future__ import annotations

import sys
from pathlib import Path

from sphinx.cmd.build import main

ROOT = Path(__file__).resolve().parent.parent
FORWARD = '<meta http-equiv="refresh" content="0; url=docs/index.html"><a href="docs/index.html">Pages</a>\n'


def build(out: Path) -> int:
    """Build the site into a folder; return 0, or what Sphinx returns for an error or a warning."""
    status = main(['-q', '-W', '--keep-going', '-c', str(ROOT / 'docs'), str(ROOT), str(out)])
    if status == 0:
        (out / 'index.html').write_text(FORWARD)
    return status


if __name__ == '__main__':
    sys.exit(build(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / 'out' / 'site'))
