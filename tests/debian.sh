#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes the Debian packages of build/release, installs the program's on a bare Debian 12 (debootstrap, as
# root) and fits the bundled capture there: tests/debian.sh [DIR]. A command of its own: it takes the
# network and some minutes. DIR (default build/debian) keeps packages and root.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
work=$(mkdir -p "${1:-build/debian}" && cd "${1:-build/debian}" && pwd)
root=$work/root
command -v debootstrap >/dev/null || { echo "debian.sh: needs debootstrap (Debian: debootstrap)" >&2; exit 2; }

(cd build/release && cpack -G DEB -B "$work/packages")
[[ -e $root/etc/debian_version ]] ||
  debootstrap --variant=minbase bookworm "$root" http://deb.debian.org/debian
cp /etc/resolv.conf "$root/etc/"
cp "$work"/packages/blindcorner_*.deb "$root/root/blindcorner.deb"
chroot "$root" sh -ec '
  apt-get update -q
  DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends --reinstall /root/blindcorner.deb
  cd /root
  scenes=/usr/share/blindcorner/scenes
  blindcorner fit $scenes/tmf8828_wall.json $scenes/captures/tmf8828_wall.exr -o out
  test -s out/result.json -a -s out/result.html -a -s /usr/share/blindcorner/schema/scene.schema.json
  test -s /usr/share/bash-completion/completions/blindcorner
'
echo "installed, fitted: $root/root/out"
