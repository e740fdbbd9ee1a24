#!/usr/bin/env bash
# Installs missing packages, then runs every check: ruff, mypy, pytest (which starts its two-rank tests by mpirun).
#
#   bash tests/run.sh [options of pytest; paths are those of the checkout]
#
# All checks run even if one fails; then the exit code is non-zero. The test files are distributed over one process per
# core, four at most (-n 0: one after another in this process, for a debugger). mypy runs in parallel to them; its output is
# shown at the end.
set -euo pipefail
# shellcheck source=runs/setup.sh
. "$(dirname -- "${BASH_SOURCE[0]}")/../runs/setup.sh"
set_up test

cd -- "$checkout"
summary=() failed=0
# check NAME COMMAND...
check() {
  local name=$1 status=0 begin=$SECONDS seconds
  shift
  echo "tests: $name"
  "$@" || status=$?
  seconds=$((SECONDS - begin))
  # a parallel check ended at its last output
  [[ ! -e $beside/$name ]] || seconds=$(($(stat -c %Y "$beside/$name") - begun[$name]))
  if ((status)); then
    failed=1
    summary+=("$name FAILED (exit code $status, $seconds s)")
  else
    summary+=("$name passed ($seconds s)")
  fi
}
beside=$(mktemp -d)
declare -A jobs=() begun=()
trap 'kill "${jobs[@]}" 2>/dev/null || true; rm -rf "$beside"' EXIT
# begin NAME COMMAND...: starts a check in parallel; "check NAME end_of NAME" waits for it and prints its output.
begin() {
  local name=$1
  shift
  "$@" >"$beside/$name" 2>&1 &
  jobs[$name]=$! begun[$name]=$(date +%s)
}
end_of() {
  local status=0
  wait "${jobs[$1]}" || status=$?
  unset "jobs[$1]"
  cat "$beside/$1"
  return "$status"
}
check ruff .venv/bin/python -m ruff check .
check format .venv/bin/python -m ruff format --check .
# numpy 2 annotates return types differently, and each version in another way: types are checked only with numpy 1 (Debian 12).
if [[ $(.venv/bin/python -c 'import numpy; print(numpy.__version__)') == 1.* ]]; then
  begin mypy .venv/bin/python -m mypy
else
  summary+=("mypy not run: it needs the annotations of numpy 1, which Debian 12 has")
fi
workers=$(env -u OMP_NUM_THREADS nproc) # nproc would take that variable for the number of cores
# Files with slow tests start first (tests/conftest.py), so that the last ones are short.
parallel=(-n $((workers < 4 ? workers : 4)) --dist loadfile --no-loadscope-reorder --durations 15)
check pytest .venv/bin/python -m pytest "${parallel[@]}" "$@"
for name in "${!jobs[@]}"; do
  check "$name" end_of "$name"
done
printf 'tests: %s\n' "${summary[@]}"
exit "$failed"
