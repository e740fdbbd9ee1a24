#!/usr/bin/env bash
# Tests the README's two commands on a bare Debian: a debootstrapped root with only the base system.
#
#   tests/on_debian.sh RELEASE [quickstart|tests|both|setup] [options] [-- options of tests/run.sh]
#
# RELEASE is 12 (DOLFINx 0.5), 13 (0.9), sid (the newest of Debian) or a code name. `both` is the default; `setup` is the set-up of
# both without their jobs. Prints a table at the end: command, seconds, exit code; exits with 1 if a command did not end as expected.
#   --user         run as an ordinary user without sudo, before the Debian packages are installed (the command must refuse
#                  with a clear message) and again after root has installed them
#   --commit REV   test that commit; without it, the files of the working tree that git does not ignore
#   --keep         continue in the root of the last run; without it, the root is a bare base system again (with packages from the
#                  cache, this takes minutes, not an hour)
#   --cache DIR    where the base system, the Debian packages and the root are kept (default /var/tmp/thirdbody-debian-RELEASE)
#   --ca FILE      certificates that pip trusts inside (default: those PIP_CERT or SSL_CERT_FILE name here, if either is set)
#
# Needs root, 8 GB of disk per release, and the network (deb.debian.org, pypi.org). All runs in separate namespaces: mounts and
# processes always end with the script. Two releases may be tested at the same time, each by one run only.
set -euo pipefail
mirror=http://deb.debian.org/debian
checkout=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)

stop() {
  printf 'on_debian: %s\n' "$@" >&2
  exit 2
}

usage() {
  sed -n '2,/^set -/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
  exit "$1"
}

release='' suite='' what=both account=root extra=() commit='' keep=no cache='' ca=${PIP_CERT:-${SSL_CERT_FILE:-}}
arguments=("$@")
while (($#)); do
  case $1 in
    --user) account=tester ;;
    --commit) commit=${2:?--commit needs a revision} && shift ;;
    --keep) keep=yes ;;
    --cache) cache=${2:?--cache needs a folder} && shift ;;
    --ca) ca=${2:?--ca needs a file} && shift ;;
    quickstart | tests | both | setup) what=$1 ;;
    -h | --help) usage 0 ;;
    --) extra=("${@:2}") && break ;;
    12 | bookworm) release=12 suite=bookworm ;;
    13 | trixie) release=13 suite=trixie ;;
    sid | unstable) release=sid suite=sid ;;
    *) stop "what is '$1'?" "see: tests/on_debian.sh --help" ;;
  esac
  shift
done
[[ -n $release ]] || usage 2
((EUID == 0)) || stop "needs root, for debootstrap and chroot: sudo $0 ${arguments[*]}"
[[ -z $ca || -r $ca ]] || stop "cannot read the certificates $ca"
((${#extra[@]} == 0)) || [[ $what == tests || $what == both ]] || stop "options after -- are for tests/run.sh; '$what' does not run it"
cache=${cache:-/var/tmp/thirdbody-debian-$release}
root=$cache/root base=$cache/base.tar inside=/srv/thirdbody
if [[ $account != root ]]; then inside=/home/$account/thirdbody; fi

if [[ ${THIRDBODY_NAMESPACE:-} != inside ]]; then
  if ! command -v debootstrap >/dev/null; then
    DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends debootstrap >/dev/null ||
      stop "cannot install debootstrap; by hand: apt-get update && apt-get install debootstrap"
  fi
  mkdir -p "$cache/packages/partial"
  exec 9>"$cache/lock"
  flock -n 9 || stop "another run uses $cache: wait for it, or name another --cache"
  unshare --mount --pid --fork --propagation private true 2>/dev/null ||
    stop "this machine does not let root make namespaces (an unprivileged container?)" "in a container: docker run --privileged ..."
  export THIRDBODY_NAMESPACE=inside
  exec unshare --mount --pid --fork --kill-child --propagation private bash "${BASH_SOURCE[0]}" "${arguments[@]}"
fi
trap 'exit 130' INT TERM

make_base() {
  local log=$cache/debootstrap.log script=()
  if [[ ! -e /usr/share/debootstrap/scripts/$suite ]]; then script=(sid); fi # an older debootstrap than the release
  echo "on_debian: making the base system of $suite"
  (($(df --output=avail -k "$cache" | tail -n 1) > 8000000)) || stop "$cache has less than 8 GB free: make room, or name another --cache"
  rm -rf "$cache/base"
  debootstrap --variant=minbase "$suite" "$cache/base" "$mirror" ${script[@]+/usr/share/debootstrap/scripts/"${script[@]}"} >"$log" 2>&1 ||
    { tail -n 5 "$log" >&2 && stop "debootstrap failed; all it printed is in $log"; }
  rm -f "$cache/base/var/cache/apt/archives/"*.deb
  tar --numeric-owner -C "$cache/base" -cf "$base.part" . && mv "$base.part" "$base"
  rm -rf "$cache/base"
}

make_root() {
  if [[ $keep == no || ! -x $root/bin/bash ]]; then
    rm -rf "$root"
    mkdir "$root"
    tar --numeric-owner -C "$root" -xpf "$base"
  fi
  mount -t proc proc "$root/proc"
  mount -t sysfs -o ro sysfs "$root/sys"
  mount -t tmpfs -o mode=1777 tmpfs "$root/dev/shm"
  mount -t devpts -o newinstance,ptmxmode=0666,mode=0620,gid=5 devpts "$root/dev/pts"
  mount --bind "$cache/packages" "$root/var/cache/apt/archives"
  cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
  if [[ -n $ca ]]; then cp -L -- "$ca" "$root/etc/on-debian-ca.pem"; fi
  if [[ $account != root ]] && ! chroot "$root" id "$account" >/dev/null 2>&1; then chroot "$root" useradd --create-home "$account"; fi
}

copy_checkout() {
  mkdir -p "$root$inside"
  find "$root$inside" -mindepth 1 -maxdepth 1 ! -name .venv ! -name out -exec rm -rf {} +
  if [[ -n $commit ]]; then
    commit=$(git -C "$checkout" -c safe.directory="$checkout" rev-parse --short "$commit^{commit}")
    git -C "$checkout" -c safe.directory="$checkout" archive "$commit" | tar -C "$root$inside" -x
  else
    git -C "$checkout" -c safe.directory="$checkout" ls-files -z --cached --others --exclude-standard |
      tar -C "$checkout" --null --files-from=- --ignore-failed-read -c 2>/dev/null | tar -C "$root$inside" -x
  fi
  if [[ $account == root ]]; then
    chown -R 0:0 "$root$inside"
  else
    chroot "$root" chown -R "$account:" "$inside"
  fi
}

passed=()
for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY PIP_INDEX_URL PIP_EXTRA_INDEX_URL PIP_TRUSTED_HOST PIP_DEFAULT_TIMEOUT; do
  if [[ -n ${!name:-} ]]; then passed+=("$name=${!name}"); fi
done
if [[ -n $ca ]]; then passed+=(PIP_CERT=/etc/on-debian-ca.pem); fi

summary=() faults=0
# run NAME EXPECTED ACCOUNT COMMAND...: in the root, with the environment of a first login; EXPECTED is `works` or `refuses`.
run() {
  local name=$1 expected=$2 who=$3 status=0 begin seconds verdict=ok home=/root
  shift 3
  if [[ $who != root ]]; then home=/home/$who; fi
  echo "on_debian: $name: $* (as $who)"
  begin=$(date +%s%N)
  chroot "$root" runuser -u "$who" -- env -i HOME="$home" USER="$who" PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    "${passed[@]}" "$@" </dev/null 2>&1 | tee "$cache/$name.log" | sed -u 's/^/  /' || status=$?
  seconds=$((($(date +%s%N) - begin) / 100000000))
  if [[ ($expected == works && $status != 0) || ($expected == refuses && $status == 0) ]]; then
    verdict="NOT AS EXPECTED" faults=1
  fi
  summary+=("$(printf '%-22s %7s s   exit code %-3s (it %s: %s)' "$name" "$((seconds / 10)).$((seconds % 10))" "$status" "$expected" "$verdict")")
}

# installed PACKAGE: its version in the root, without Debian's own part.
installed() { chroot "$root" dpkg-query -W -f='${Version}' "$1" 2>/dev/null | sed 's/^[0-9]*://; s/-[^-]*$//' || true; }

[[ -s $base ]] || make_base
make_root
copy_checkout

case $what in
  quickstart) commands=("quickstart runs/quickstart.sh") again=run ;;
  tests) commands=("tests tests/run.sh") again=test ;;
  both) commands=("quickstart runs/quickstart.sh" "tests tests/run.sh") again=test ;;
  setup) commands=("setup-run runs/setup.sh run" "setup-test runs/setup.sh test") again=test ;;
esac
if [[ $account != root && $keep == no ]]; then
  read -r _ script _ <<<"${commands[0]}"
  run without-packages refuses "$account" bash "$inside/$script"
  run packages works root bash "$inside/runs/setup.sh" packages
fi
for command in "${commands[@]}"; do
  read -ra words <<<"$command"
  if [[ ${words[1]} == tests/run.sh ]]; then words+=(${extra[@]+"${extra[@]}"}); fi
  run "${words[0]}" works "$account" bash "$inside/${words[1]}" "${words[@]:2}"
done
run setup-again works "$account" bash "$inside/runs/setup.sh" "$again"

echo
echo "on_debian: Debian $(<"$root/etc/debian_version") ($suite), $(chroot "$root" dpkg-query -W -f='.' | wc -c) packages, as $account${commit:+, commit $commit}"
echo "  DOLFINx $(installed python3-dolfinx-real), PETSc $(installed python3-petsc4py-real), numpy $(installed python3-numpy), gmsh $(installed python3-gmsh)"
if [[ -s $cache/tests.log && " ${commands[*]} " == *" tests/run.sh"* ]]; then grep -E '^=+ .* (passed|failed|error)' "$cache/tests.log" | sed 's/^/  /' || true; fi
printf '  %s\n' "${summary[@]}"
echo "on_debian: logs are in $cache, the root is $root"
exit "$faults"
