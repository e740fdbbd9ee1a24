#!/usr/bin/env bash
# Tests runs/cluster/thirdbody.slurm on a real Slurm of one node, which this script starts and ends; run by hand, as root.
#
#   apt-get install slurm-wlm munge openmpi-bin
#   tests/on_slurm.sh [SCENE]
#
# Submits the scene (default: a pair on a coarse mesh) on two ranks with multigrid, sends the job the signal that
# Slurm sends before its time limit, and checks that it is queued again and completes. An installed Slurm or munge is
# neither read nor changed: configuration, keys, sockets and state are in a temporary folder.
set -euo pipefail

checkout=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
fail() {
  printf 'on_slurm.sh: %s\n' "$@" >&2
  exit 1
}
((EUID == 0)) || fail "slurmd starts jobs as root only: call this script as root"
for program in munged slurmctld slurmd sbatch; do
  command -v "$program" >/dev/null || fail "there is no $program: apt-get install slurm-wlm munge"
done

folder=$(mktemp -d) daemons=()
finish() {
  for daemon in "${daemons[@]}"; do kill "$daemon" 2>/dev/null || true; done
  wait
  rm -rf -- "$folder"
}
trap finish EXIT
mkdir "$folder/state" "$folder/spool"
head -c 1024 /dev/urandom >"$folder/munge.key"
chmod 600 "$folder/munge.key"
cat >"$folder/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$(hostname -s)
SlurmctldPort=46817
SlurmdPort=46818
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
ReturnToService=2
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
$(slurmd -C | head -1) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf
munged --foreground --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" --num-threads=2 \
  --pid-file="$folder/munged.pid" --log-file="$folder/munged.log" --seed-file="$folder/seed" >"$folder/munged.out" 2>&1 &
daemons+=($!)
slurmctld -D >"$folder/slurmctld.log" 2>&1 &
daemons+=($!)
slurmd -D >"$folder/slurmd.log" 2>&1 &
daemons+=($!)
for _ in {1..60}; do
  [[ $(sinfo --noheader --format=%t 2>/dev/null) == idle ]] && break
  sleep 1
done
[[ $(sinfo --noheader --format=%t) == idle ]] || fail "the node is not idle:" "$(tail -n 5 "$folder"/*.log)"

scene=${1:-$folder/scene.toml}
if (($# == 0)); then
  cat >"$scene" <<SCENE
[layer]
thickness = 1.16
young = 1.0
poisson = 0.3
[balls]
radius = 1.0
positions = [[-1.0, 0.0], [1.0, 0.0]]
[load]
approach = 0.1
steps = [0.04, 0.07, 0.1]
[finite_strain]
law = "neo_hookean"
[accuracy]
tangential_force = 0.1
unknowns = 20000
SCENE
fi
export LAUNCHER="mpirun --bind-to none" OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export PETSC_OPTIONS=${PETSC_OPTIONS:--thirdbody_direct_up_to 1000}
cd -- "$checkout"
job=$(sbatch --parsable --ntasks=2 --time=60 --output="$folder/job.txt" runs/cluster/thirdbody.slurm \
  solve "$scene" --out "$folder/out")
echo "on_slurm.sh: job $job"
state() { scontrol --oneliner show job "$job" | tr ' ' '\n' | sed -n "s/^$1=//p"; }
saved() { find "$folder/out" -name '*.npz' -o -name 'step*' 2>/dev/null | head -1; }
signalled=no
for _ in {1..3600}; do
  now=$(state JobState)
  case $now in COMPLETED | FAILED | TIMEOUT | CANCELLED | NODE_FAIL) break ;; esac
  if [[ $signalled == no && $now == RUNNING && -n $(saved) ]]; then # a step is saved: send the signal
    scancel --batch --signal=USR1 "$job"
    signalled=yes
    echo "on_slurm.sh: signalled with $(saved) saved"
  elif [[ $now == PENDING && $signalled == yes ]]; then
    scontrol update JobId="$job" StartTime=now 2>/dev/null || true # Slurm waits two minutes before it starts again
  fi
  sleep 1
done
cat "$folder/job.txt"
[[ $now == COMPLETED ]] || fail "the job ended as $now"
[[ $signalled == no || $(state Restarts) == 1 ]] || fail "the job was not queued again"
"${VENV:-$checkout/.venv}/bin/python" - "$folder/out/result.json" <<'CHECK'
import json, sys
solved = json.load(open(sys.argv[1], encoding="utf-8"))["solved"]
print("on_slurm.sh:", {key: solved.get(key) for key in ("converged", "unknowns", "ranks", "linear_solver")})
assert solved["converged"] and solved["ranks"] == 2, solved
CHECK
