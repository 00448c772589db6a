#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
# Write requirements.txt anew: what Ubuntu 24.04 lacks, in the versions and with the markers of tools/requirements.txt; then check
# that each Python and processor finds wheels. `lock.sh --check` only checks. Needs uv.
set -euo pipefail
cd "$(dirname "$0")"
names=(dynamixel-sdk pymoo rosbags skops ur-rtde)
if [[ ${1:-} != --check ]]; then
  # What apt brings, and what matplotlib from apt brings along, is never installed over.
  apt=(contourpy cycler fonttools kiwisolver packaging pillow pyparsing python-dateutil)
  mapfile -t pinned < <(sed -n 's/==.*//p' ubuntu.txt)
  for name in "${names[@]}"; do sed -n "s/^\($name==[^\\\\]*\).*/\1/p" ../tools/requirements.txt; done |
    uv pip compile - --python-version 3.12 --constraint ubuntu.txt --generate-hashes --no-annotate --no-header \
      "${apt[@]/#/--no-emit-package=}" "${pinned[@]/#/--no-emit-package=}" --universal --quiet --output-file requirements.txt
fi
for python in 3.12 3.13 3.14; do
  for platform in x86_64-manylinux_2_35 aarch64-manylinux_2_35; do
    uv pip install --quiet --dry-run --target "${TMPDIR:-/tmp}/lock-check" --python-version "$python" --python-platform "$platform" \
      --only-binary :all: --no-deps --require-hashes --requirement requirements.txt ||
      { echo "docker/requirements.txt has no wheel for Python $python on $platform, see above" >&2; exit 1; }
  done
done
