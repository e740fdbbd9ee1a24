#!/usr/bin/env bash
# Installs what is missing, then runs every check: ruff, mypy, pytest (which starts its two-rank tests through mpirun).
#
#   bash tests/run.sh [options of pytest; paths are those of the checkout]
#
# All of them run even if one fails; the exit code is non-zero if any did. The files of tests are shared out to as many processes
# as there are cores, four at most (-n 0: one after another in this process, for a debugger). mypy and the tests of pictures, one
# process each, run beside them: what they print is shown at the end.
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
  # a check that ran beside the others ended when it last printed
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
# begin NAME COMMAND...: starts a check beside the others; "check NAME end_of NAME" waits for it and prints its output.
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
# numpy 2 annotates what it returns otherwise, and differently in each version: types are checked where numpy 1 is (Debian 12).
if [[ $(.venv/bin/python -c 'import numpy; print(numpy.__version__)') == 1.* ]]; then
  begin mypy .venv/bin/python -m mypy
else
  summary+=("mypy not run: it goes by the annotations of numpy 1, which Debian 12 has")
fi
workers=$(env -u OMP_NUM_THREADS nproc) # which takes that variable for the number of cores
# Files with slow tests come first (tests/conftest.py): the last files to end are short ones.
parallel=(-n $((workers < 4 ? workers : 4)) --dist loadfile --no-loadscope-reorder --durations 15)
drawing=tests/runs/test_rendering.py
if (($#)); then
  check pytest .venv/bin/python -m pytest "${parallel[@]}" "$@"
else
  # VTK gets a process of its own: in one that has solved finite elements before, it ended in a segmentation fault
  begin pictures .venv/bin/python -m pytest "$drawing"
  check pytest .venv/bin/python -m pytest "${parallel[@]}" --ignore "$drawing"
fi
for name in "${!jobs[@]}"; do
  check "$name" end_of "$name"
done
printf 'tests: %s\n' "${summary[@]}"
exit "$failed"
