#!/usr/bin/env bash
# Installs the package where nothing else is, and tries it: clean_root.sh PACKAGE FOLDER
# As root. FOLDER becomes a Debian 12 by debootstrap; some minutes the first time.
set -euo pipefail
(($# == 2)) && [[ -f $1 ]] || { echo "usage: clean_root.sh PACKAGE FOLDER" >&2; exit 2; }
root=$2
command -v debootstrap lintian >/dev/null || apt-get install -q -y --no-install-recommends debootstrap lintian
lintian --fail-on error "$1"
[[ -d $root/usr ]] || debootstrap --variant=minbase bookworm "$root"
cp "$1" "$root/tmp/ves.deb"
mount -t proc proc "$root/proc"
trap 'umount "$root/proc"' EXIT
chroot "$root" bash -euxc '
  export DEBIAN_FRONTEND=noninteractive LC_ALL=C
  apt-get update -q
  apt-get install -q -y /tmp/ves.deb man-db bash-completion
  cd /root
  ves --version
  ves demo --lockstep
  ves run arm_on_desk --lockstep --quiet
  man ves | head -n 12
  source /usr/share/bash-completion/completions/ves
  COMP_WORDS=(ves run srms_c) COMP_CWORD=2
  _ves || true
  [[ ${COMPREPLY[*]} == *srms_capture_doss* ]]
  apt-get purge -q -y ves
  [[ ! -e /usr/share/ves && ! -e /usr/include/ves && ! -e /usr/bin/ves ]]'
echo "clean root: all well"
