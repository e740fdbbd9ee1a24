#!/usr/bin/env bash
# Builds the handbook in out/handbook/html: installs missing packages and runs the tutorials; warnings are errors.
#
#   bash runs/handbook/build.sh
set -euo pipefail
# shellcheck source=runs/setup.sh
. "$(dirname -- "${BASH_SOURCE[0]}")/../setup.sh"
set_up docs
cd -- "$checkout"
exec .venv/bin/python -m runs.handbook.build
