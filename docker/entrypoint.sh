#!/usr/bin/env bash
# Run a command inside the workspace.
set -e
# shellcheck source=/dev/null
source /opt/ros/jazzy/setup.bash
# shellcheck source=/dev/null
source /opt/tactile_texture/setup.bash
exec "$@"
