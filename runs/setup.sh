#!/usr/bin/env bash
# Sets up this checkout: installs Debian packages, makes a .venv from /usr/bin/python3, and installs the project in it.
#
#   bash runs/setup.sh [run|render|docs|test|packages]
#
# run: packages for simulations (the default); render: also pyvista (150 MB), for `thirdbody render`; docs: run
# and Sphinx, for the handbook; test: all of these and ruff, mypy, pytest, meshio; packages: only the Debian packages.
# runs/quickstart.sh and tests/run.sh source this file. Installed packages are not installed again, and an interrupted
# set-up continues where it stopped.

checkout=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)
venv=$checkout/.venv
log='' ticker=''
debian_packages=(ca-certificates python3 python3-venv python3-dolfinx-real python3-gmsh python3-h5py python3-scipy python3-matplotlib
  openmpi-bin libegl1)
blas_packages=(libopenblas0-serial libopenblas0-pthread libopenblas0-openmp) # any one will do; the first is installed

say() { printf 'setup: %s\n' "$*"; }

# stop WHAT [REMEDY...]: prints the failure and the commands that repair it, and exits.
stop() {
  printf 'setup: %s\n' "$1" >&2
  shift
  if (($#)); then printf '       %s\n' "$@" >&2; fi
  exit 1
}

# stop_with_log WHAT [REMEDY...]: the same, after the last lines of the failed step (without mpirun's messages, framed by dashes).
stop_with_log() {
  tail -c "+$((log_mark + 1))" "$log" | sed '/^-\{60,\}$/,/^-\{60,\}$/d' | tail -n 12 | sed 's/^/  | /' >&2
  stop "$@" "All that was printed is in $log"
}

# logged WORDS COMMAND...: runs a command with one line for the user, its output in the log, and a line every minute.
logged() {
  local words=$1 status=0
  shift
  say "$words"
  if [[ -z $log ]]; then log=$(mktemp "${TMPDIR:-/tmp}/thirdbody-setup-XXXXXX.log"); fi
  log_mark=$(wc -c <"$log")
  (
    seconds=0
    while sleep 5 >/dev/null 2>&1; do
      seconds=$((seconds + 5))
      if ((seconds % 60 == 0)); then say "  still running after $((seconds / 60)) min (to follow: tail -f $log)"; fi
    done
  ) 9>&- &
  ticker=$!
  trap 'kill "$ticker" 2>/dev/null' EXIT
  trap 'say "interrupted; run it again and it continues from here" >&2; exit 130' INT
  "$@" </dev/null >>"$log" 2>&1 9>&- || status=$?
  kill "$ticker" 2>/dev/null
  wait "$ticker" 2>/dev/null || true
  trap - EXIT INT
  return "$status"
}

log_says() { grep -qiE -- "$1" < <(tail -c "+$((log_mark + 1))" "$log"); }

check_system() {
  [[ $(uname -s) == Linux ]] || stop "this set-up is for Debian GNU/Linux; here is $(uname -s)." \
    "Use a Debian 12 or 13 machine, virtual machine or container: docker run -it -v '$checkout:/thirdbody' debian:12 bash"
  local ID='' VERSION_ID='' PRETTY_NAME='an unknown Linux'
  # shellcheck source=/dev/null
  if [[ -r /etc/os-release ]]; then . /etc/os-release; fi
  system_name=$PRETTY_NAME system_note=''
  if [[ $ID == debian && -n $VERSION_ID ]] && ((${VERSION_ID%%.*} < 12)); then
    stop "$PRETTY_NAME is too old: its DOLFINx and Python cannot run this project, which needs Debian 12 (bookworm) or 13 (trixie)." \
      "Upgrade, or use a container: docker run -it -v '$checkout:/thirdbody' debian:12 bash"
  fi
  if [[ $ID != debian || ($VERSION_ID != 12 && $VERSION_ID != 13) ]]; then
    system_note="$PRETTY_NAME is not a tested system (Debian 12, 13, sometimes sid); continuing."
  fi
}

find_missing_packages() {
  local installed
  installed=$(dpkg-query -W -f='${Package} ${db:Status-Status}\n' "${debian_packages[@]}" "${blas_packages[@]}" 2>/dev/null | sed -n 's/ installed$//p') || true
  mapfile -t missing < <(printf '%s\n' "${debian_packages[@]}" | grep -vxF -- "$installed")
  grep -qxF -- "$installed" < <(printf '%s\n' "${blas_packages[@]}") || missing+=("${blas_packages[0]}")
}

become_root() {
  local by_hand="apt-get update && apt-get install --no-install-recommends ${missing[*]}"
  as_root=(env)
  if ((EUID == 0)); then return; fi
  say "Debian packages are missing: ${missing[*]}"
  command -v sudo >/dev/null || stop "cannot install them: you are not root and there is no sudo here." \
    "As root:     $by_hand" "Then again:  bash ${0@Q}"
  if { : </dev/tty; } 2>/dev/null; then
    as_root=(sudo env)
    sudo true || stop "cannot install them: sudo refused." "As root:     $by_hand" "Then again:  bash ${0@Q}"
  else
    as_root=(sudo -n env)
    sudo -n true 2>/dev/null || stop "cannot install them: sudo needs a password and there is no terminal to ask for it." \
      "In a terminal:  sudo sh -c '$by_hand'" "Then again:     bash ${0@Q}"
  fi
}

install_packages() {
  local apt install extent status=0 updated=yes
  become_root
  apt=("${as_root[@]}" LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=600
    -o Dpkg::Options::=--force-confdef -o Dpkg::Options::=--force-confold)
  if [[ -n $(dpkg --audit 2>/dev/null) ]]; then
    logged "finishing an interrupted installation of Debian packages" "${as_root[@]}" LC_ALL=C DEBIAN_FRONTEND=noninteractive dpkg --configure -a || true
  fi
  logged "reading the package lists (apt-get update)" "${apt[@]}" -o APT::Update::Error-Mode=any update || updated=no
  install=(install --fix-broken --no-install-recommends --no-remove "${missing[@]}")
  extent=$("${apt[@]}" "${install[@]}" --assume-no 2>/dev/null </dev/null |
    sed -nE 's/^Need to get (.*) of archives.*/\1 to download/p; s/^After this operation, (.*) of additional.*/\1 on disk/p' | paste -sd+ | sed 's/+/, /') || true
  logged "installing Debian packages: ${missing[*]}${extent:+ and what they need ($extent)}" "${apt[@]}" -y "${install[@]}" || status=$?
  if ((status == 0)); then return; fi
  local sudo="${as_root[*]}"
  sudo=${sudo%env}
  local again="${sudo}apt-get update && ${sudo}apt-get install --no-install-recommends ${missing[*]}"
  if log_says 'Packages need to be removed but remove is disabled'; then
    stop_with_log "apt-get would have to remove packages you have; that is for you to decide." "See what:  $again"
  elif log_says 'enough free space|No space left'; then
    stop_with_log "the disk is too full for the Debian packages${extent:+ ($extent)}." "Make room (apt-get clean; df -h / /var), then run this again."
  elif log_says 'Could not get lock|Unable to acquire the dpkg frontend lock'; then
    stop_with_log "another program is installing packages." "Wait until it has ended, then run this again."
  elif log_says 'Temporary failure resolving|Could not resolve|Could not connect|Unable to connect|Connection (failed|timed out)|Network is unreachable'; then
    stop_with_log "cannot reach the Debian mirror: no network, or a proxy is needed (http_proxy)." "When it is reachable, run this again."
  elif log_says 'Unable to locate package|has no installation candidate'; then
    local why="the sources of apt do not offer them"
    if [[ $updated == no ]]; then why="the package lists could not be read (no network?)"; fi
    stop_with_log "cannot find some of the packages on $system_name: $why." \
      "Debian 12 needs this line in /etc/apt/sources.list:  deb http://deb.debian.org/debian bookworm main" "Then run this again."
  fi
  stop_with_log "apt-get could not install the Debian packages." "By hand:  $again"
}

ensure_packages() {
  if command -v apt-get >/dev/null && command -v dpkg-query >/dev/null; then
    find_missing_packages
    if ((${#missing[@]} == 0)); then return; fi
    if [[ -n $system_note ]]; then say "$system_note"; fi
    install_packages
  elif ! /usr/bin/python3 -c 'import dolfinx, petsc4py, mpi4py, gmsh, h5py, scipy, matplotlib, venv' 2>/dev/null; then
    stop "$system_name has no apt-get, and its /usr/bin/python3 cannot import all of: dolfinx petsc4py mpi4py gmsh h5py scipy matplotlib." \
      "Install them for /usr/bin/python3 (DOLFINx 0.5 to 0.11 with real PETSc) and run this again, or use a container:" \
      "docker run -it -v '$checkout:/thirdbody' debian:12 bash"
  fi
}

check_blas() {
  local name mode library
  while read -r name mode library; do
    case $name:$library in
      libblas.so.3*:*/blas/libblas.so.3)
        say "note: $name is the slow reference BLAS (set to $mode): right results, direct solves 5 to 6 times slower."
        printf '       Repair it, as root:  update-alternatives --auto %s\n' "$name"
        ;;
    esac
  done < <(update-alternatives --get-selections 2>/dev/null)
}

check_python() {
  [[ -x /usr/bin/python3 ]] || stop "there is no /usr/bin/python3, the Python that Debian's DOLFINx belongs to." "As root:  apt-get install --reinstall python3-minimal python3"
  python_version=$(/usr/bin/python3 -c 'import sys; print("%d.%d" % sys.version_info[:2]); sys.exit(sys.version_info < (3, 11))') ||
    stop "/usr/bin/python3 is Python ${python_version:-of an unknown version}; Python 3.11 or newer is needed." "Use Debian 12 or 13."
}

# Hash of everything whose change requires a new set-up; it is part of the stamp's name.
fingerprint() {
  {
    cat "$checkout/pyproject.toml" "$checkout/runs/setup.sh"
    printf '%s\n' "$checkout" "$python_version"
    dpkg-query -W "${debian_packages[@]}" python3-numpy python3-mpi4py 2>/dev/null
  } | sha256sum | cut -c 1-12
}

ensure_venv() {
  local mark=$venv/.thirdbody-venv fault=''
  if [[ -e $mark && $(<"$mark") == begun ]]; then
    fault="its creation was interrupted"
  elif [[ -e $venv/pyvenv.cfg || -e $venv/bin ]]; then
    grep -qE '^include-system-site-packages *= *true' "$venv/pyvenv.cfg" 2>/dev/null || fault="it does not see Debian's packages"
    grep -qE '^home *= */usr/bin/?$' "$venv/pyvenv.cfg" 2>/dev/null || fault="it is made by another Python than /usr/bin/python3"
    [[ -d $venv/lib/python$python_version ]] || fault="it is made for another version than Python $python_version"
    "$venv/bin/python" -I -m pip --version 2>/dev/null | grep -qF " from $venv/" || fault=${fault:-"it has no working pip"}
    if [[ -z $fault ]]; then return; fi
  else
    fault=absent
  fi
  if [[ $fault != absent ]]; then
    [[ -e $mark ]] || stop "cannot use .venv: $fault." "Move it away and run this again:  mv '$venv' '$venv.old'"
    say "making .venv again: $fault"
    rm -rf "${venv:?}"/{bin,include,lib,lib64,share,pyvenv.cfg} "$venv"/.thirdbody-*-{run,render,docs,test}
  fi
  printf begun >"$mark"
  logged "making .venv from /usr/bin/python3 (Python $python_version)" /usr/bin/python3 -m venv --system-site-packages "$venv" ||
    stop_with_log "cannot make .venv." "Try:  rm -rf '$venv' and run this again"
  printf made >"$mark"
}

# DOLFINx was built for Debian's numpy: no wheel may replace a package of the system.
write_requirements() {
  "$venv/bin/python" -I - "$checkout/pyproject.toml" "$venv" "$@" <<'PYTHON'
import re, sys, tomllib
from importlib import metadata
from pathlib import Path

pyproject, venv, extras = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:]
ours = ["numpy", "scipy", "matplotlib", "h5py", "mpi4py", "petsc4py", "gmsh", "fenics-dolfinx", "fenics-ufl", "fenics-basix"]
constraints = []
for name in ours:
    try:
        constraints.append(f"{name}=={metadata.version(name)}")
    except metadata.PackageNotFoundError:  # Debian 12 has h5py and gmsh under no such name
        constraints.append(f"{name}<0")
project = tomllib.loads(pyproject.read_text())["project"]
wanted = project["dependencies"] + [line for extra in extras for line in project["optional-dependencies"][extra]]
requirements = [line for line in wanted if re.match(r"[\w.-]+", line)[0].lower() not in ours]
(venv / "constraints.txt").write_text("\n".join(constraints) + "\n")
(venv / "requirements.txt").write_text("\n".join(requirements) + "\n")
# what users install into .venv later keeps to them, too
words = "# what the system has must not come from pip; h5py<0 and gmsh<0: never, Debian has them under no such name\n"
(venv / "pip.conf").write_text(f"{words}[install]\nconstraint = {(venv / 'constraints.txt').as_uri()}\n")
PYTHON
}

# Sets hiding: packages in .venv that hide those of the system.
find_hiding() {
  local name folder=$venv/lib/python$python_version/site-packages
  hiding=()
  for name in numpy scipy h5py mpi4py petsc4py; do
    if [[ -e $folder/$name/__init__.py ]]; then hiding+=("$name"); fi
  done
}

stop_for_pip() {
  if log_says 'CERTIFICATE_VERIFY_FAILED|SSLError|invalid path: .*(cert|pem|crt)'; then
    stop_with_log "pip does not trust the certificate of the package index." "Behind a company proxy, name its certificate bundle and run this again:  export PIP_CERT=/path/to/bundle.pem"
  elif log_says 'name resolution|NewConnectionError|Failed to establish|ConnectTimeout|Network is unreachable|ProxyError|ReadTimeout'; then
    stop_with_log "pip cannot reach the Python package index: no network, or a proxy is needed (https_proxy)." "When it is reachable, run this again."
  elif log_says 'No space left'; then
    stop_with_log "the disk is too full." "Make room, then run this again."
  fi
  stop_with_log "pip could not install $1."
}

install_project() {
  local pip=(env PIP_USER=0 "$venv/bin/python" -m pip install --no-input --disable-pip-version-check)
  find_hiding
  if ((${#hiding[@]})); then
    logged "taking out of .venv what hides the packages that DOLFINx was built for: ${hiding[*]}" \
      env PIP_USER=0 "$venv/bin/python" -m pip uninstall --yes "${hiding[@]}" ||
      stop_with_log "pip could not take them out." "Make .venv again:  rm -rf '$venv'"
  fi
  write_requirements "${extras[@]}" || stop "cannot read the dependencies from $checkout/pyproject.toml." "Restore it:  git checkout pyproject.toml"
  logged "installing Python packages: $(sed 's/[^A-Za-z0-9_.-].*//' "$venv/requirements.txt" | paste -sd' ')" \
    "${pip[@]}" -c "$venv/constraints.txt" -r "$venv/requirements.txt" || stop_for_pip "the Python packages"
  if [[ ! -e $venv/.thirdbody-$hash-run ]]; then
    logged "installing the project" "${pip[@]}" --no-deps --editable "$checkout" || stop_for_pip "the project"
  fi
}

# Checks the result: every module imports, numpy and h5py are the system's, PETSc is real, two ranks see each other.
verify() {
  logged "checking the installation on two ranks" "${two_ranks[@]}" "$venv/bin/python" -c '
import importlib.util, sys
faults = []
for name in ("numpy", "scipy", "h5py", "mpi4py", "petsc4py"):
    origin = importlib.util.find_spec(name).origin
    if not origin.startswith(("/usr/lib/", "/usr/lib64/")):
        faults.append(f"{name} comes from {origin}, not from the system")
if faults:
    sys.exit("\n".join(faults))
from mpi4py import MPI
from petsc4py import PETSc
import dolfinx, gmsh, h5py, jinja2, matplotlib, numpy, pint, pydantic, rich, scipy, typer
if MPI.COMM_WORLD.size != 2:
    sys.exit(f"mpirun started {MPI.COMM_WORLD.size} ranks that see each other, not 2: it does not belong to the MPI of mpi4py")
if PETSc.ScalarType != numpy.float64:
    sys.exit("PETSc is built for complex numbers; as root: update-alternatives --auto petsc")' && return
  if log_says 'not from the system'; then
    stop_with_log "another Python's packages hide those that DOLFINx was built for." "Perhaps:  unset PYTHONPATH" "Then run this again."
  fi
  stop_with_log "installed, but it does not work: see the lines above." "If .venv is damaged:  rm -rf '$venv' and run this again"
}

# Otherwise the first run of each kind waits for the compiler.
precompile() {
  logged "compiling the finite elements of common scenes, for a minute or two" "${two_ranks[@]}" "$venv/bin/python" -m finite_strain.precompile ||
    say "they do not compile, so finite_strain will not work; for the errors:  $venv/bin/python -m finite_strain.precompile"
}

# One thread per rank, and idle ranks yield their core. Variables that the user has set remain.
set_mpi_environment() {
  export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}" PYTHONNOUSERSITE="${PYTHONNOUSERSITE:-1}"
  export OMPI_MCA_mpi_yield_when_idle="${OMPI_MCA_mpi_yield_when_idle:-1}"
  # All ranks are on this machine; Open MPI 5 complains about a network without addresses, though it does not need one.
  export OMPI_MCA_btl="${OMPI_MCA_btl:-^tcp}"
  # Containers often forbid ranks to read each other's memory.
  export OMPI_MCA_btl_vader_single_copy_mechanism="${OMPI_MCA_btl_vader_single_copy_mechanism:-none}"
  by_hand=("OMP_NUM_THREADS=$OMP_NUM_THREADS")
  if ((EUID == 0)); then
    export OMPI_ALLOW_RUN_AS_ROOT="${OMPI_ALLOW_RUN_AS_ROOT:-1}" OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="${OMPI_ALLOW_RUN_AS_ROOT_CONFIRM:-1}"
    by_hand+=(OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1)
  fi
  # DOLFINx keeps its compiled forms in the cache folder.
  local cache=${XDG_CACHE_HOME:-${HOME:-/nonexistent}/.cache}
  if ! { mkdir -p "$cache" 2>/dev/null && [[ -w $cache ]]; }; then
    export XDG_CACHE_HOME=$venv/cache
    by_hand+=("XDG_CACHE_HOME=$XDG_CACHE_HOME")
  fi
}

# Sets mpirun and the command that starts two ranks: with options, since their names as variables differ between Open MPIs.
find_mpirun() {
  mpirun=$(command -v mpirun.openmpi || command -v mpirun) || return
  two_ranks=("$mpirun" -n 2 --bind-to none)
  if [[ $("$mpirun" --version 2>/dev/null) == *"Open MPI"* ]]; then two_ranks+=(--oversubscribe); fi
}

is_ready() {
  if command -v dpkg-query >/dev/null; then
    find_missing_packages
    if ((${#missing[@]})); then return 1; fi
  fi
  [[ $1 == packages ]] && return
  [[ -x /usr/bin/python3 && -x $venv/bin/python && -x $venv/bin/thirdbody ]] || return
  check_python
  find_hiding
  hash=$(fingerprint)
  ((${#hiding[@]} == 0)) && [[ -e $venv/.thirdbody-$hash-$1 ]]
}

make_ready() {
  local folder
  if [[ $1 == packages ]]; then
    ensure_packages
    return
  fi
  mkdir -p "$venv" 2>/dev/null || true
  for folder in "$checkout" "$venv"; do
    [[ -w $folder ]] || stop "cannot write in $folder, which belongs to $(stat -c %U "$folder" 2>/dev/null || echo nobody)." \
      "Make it yours, as root:  chown -R $(id -un) '$checkout'"
  done
  # Simultaneous set-ups would interfere.
  exec 9>"$venv/.thirdbody-lock"
  if ! flock -n 9; then
    say "waiting for another set-up of this checkout to end"
    flock 9
  fi
  ensure_packages
  if ! is_ready "$1"; then
    check_python
    hash=$(fingerprint)
    find_mpirun || stop "there is no mpirun." "As root:  apt-get install openmpi-bin"
    ensure_venv
    install_project
    verify
    [[ -e $venv/.thirdbody-$hash-run ]] || precompile
    touch "$venv/.thirdbody-$hash-run" "$venv/.thirdbody-$hash-$1"
  fi
  exec 9>&-
}

# set_up run|render|docs|test|packages
set_up() {
  local hash=''
  case $1 in
    run) extras=(cli) ;;
    render) extras=(cli render) ;;
    docs) extras=(cli docs) ;;
    test) extras=(cli render docs test) ;;
    packages) extras=() ;;
    *) stop "what is '$1'?" "Usage:  bash runs/setup.sh [run|render|docs|test|packages]" ;;
  esac
  check_system
  set_mpi_environment
  is_ready "$1" || make_ready "$1"
  if [[ -n $log ]]; then rm -f "$log"; fi
  check_blas
  find_mpirun || true
}

if [[ ${BASH_SOURCE[0]} == "$0" ]]; then
  set -euo pipefail
  set_up "${1:-run}"
  if [[ ${1:-run} == packages ]]; then
    say "ready"
  else
    say "ready: the command is $venv/bin/thirdbody, or thirdbody after: source $(printf %q "$venv/bin/activate")"
  fi
fi
