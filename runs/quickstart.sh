#!/usr/bin/env bash
# From a bare Debian to a result: installs missing packages, then compares both models on the paper's thin pair, on two ranks.
#
#   bash runs/quickstart.sh [options of `thirdbody compare`]
set -euo pipefail
# shellcheck source=runs/setup.sh
. "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"
set_up run

cd -- "$checkout"
job=(.venv/bin/thirdbody compare runs/scenes/paper_thin_pair.toml "$@")
# mpirun gives its ranks a terminal of 80 columns, whatever the width of its own.
if [[ -t 1 ]]; then
  COLUMNS=${COLUMNS:-$(tput cols 2>/dev/null || echo 120)}
else
  COLUMNS=${COLUMNS:-120}
  export NO_COLOR=1 TTY_COMPATIBLE=0
fi
export COLUMNS

echo "quickstart: in $checkout: mpirun -n 2 ${job[*]}"
status=0
"${two_ranks[@]}" "${job[@]}" </dev/null || status=$?
if ((status)); then
  echo "quickstart: the job ended with exit code $status; finished parts are saved, and the same command continues from there" >&2
fi
echo "quickstart: the same by hand (a finished result is shown again; --fresh computes it again):"
echo "  cd $(printf %q "$checkout")"
if [[ $(readlink -f "$(command -v mpirun)") == $(readlink -f "$mpirun") ]]; then mpirun=mpirun; fi
options=(-n 2 --bind-to none)
if (($(lscpu -p=CORE,SOCKET 2>/dev/null | grep -vc '^#' || true) < 2)); then options+=(--oversubscribe); fi
printf '  %s' "${by_hand[*]} ${mpirun##*/} ${options[*]}"
printf ' %q' "${job[@]}"
printf '\n'
exit "$status"
