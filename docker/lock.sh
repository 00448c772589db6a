#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
# Write requirements.txt anew: what requirements.in asks for, with the versions of tools/requirements.txt where they fit.
set -euo pipefail
cd "$(dirname "$0")"
python=${1:-python3.12}
# What apt brings, and what matplotlib from apt brings along, is never installed over.
apt=(contourpy cycler fonttools kiwisolver packaging pillow pyparsing python-dateutil)
mapfile -t pinned < <(sed -n 's/==.*//p' ubuntu.txt)
uv pip compile requirements.in --python "$python" --constraint ubuntu.txt --generate-hashes --no-annotate --no-header \
  "${apt[@]/#/--no-emit-package=}" "${pinned[@]/#/--no-emit-package=}" --universal --quiet --output-file requirements.txt
