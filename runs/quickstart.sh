#!/usr/bin/env bash
# From a bare Debian to a number: installs what is missing, then sets the paper's thin pair against finite strain on two ranks.
#
#   bash runs/quickstart.sh [options of `thirdbody compare`]
set -euo pipefail
# shellcheck source=runs/setup.sh
. "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"
set_up run

cd -- "$checkout"
job=(.venv/bin/thirdbody compare runs/scenes/paper_thin_pair.toml --out out/quickstart "$@")
echo "quickstart: mpirun -n 2 ${job[*]}"
status=0
"$mpirun" -n 2 "${job[@]}" </dev/null || status=$?
if ((status)); then
  echo "quickstart: the job failed (exit code $status); what it finished is kept, and the same command goes on from there" >&2
else
  echo "quickstart: results are in $checkout/out/quickstart"
fi
echo "quickstart: the same by hand, in $checkout:"
if [[ $(readlink -f "$(command -v mpirun)") == $(readlink -f "$mpirun") ]]; then mpirun=mpirun; fi
options=(-n 2 --bind-to none)
if (($(lscpu -p=CORE,SOCKET | grep -vc '^#' || true) < 2)); then options+=(--oversubscribe); fi
printf '  %s' "${by_hand[*]} ${mpirun##*/} ${options[*]}"
printf ' %q' "${job[@]}"
printf '\n'
exit "$status"
