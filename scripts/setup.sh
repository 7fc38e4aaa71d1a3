#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Installs what BVH Lab needs on Debian 12 or 13: Debian packages, and a Python venv in .venv.
# Run it as often as you like: a run that finds everything in place takes about a tenth of a second.
# It always uses Debian's own /usr/bin/python3, because Debian's Blender runs on that one and the
# compiled module must fit it.
set -euo pipefail
cd "$(dirname "$0")/.."

python=/usr/bin/python3
requirements=scripts/requirements.txt

packages=(
  # build
  make cmake ninja-build g++ pkgconf ccache git
  libglm-dev libembree-dev libtbb-dev libopenimageio-dev pybind11-dev libhwy-dev
  opencl-headers ocl-icd-opencl-dev python3-dev python3-venv
  # run
  blender python3-numpy pocl-opencl-icd ca-certificates
  # test
  libgtest-dev openimageio-tools xvfb xauth libgl1-mesa-dri
  clang libclang-rt-dev llvm
)
# Debian 13 has no oclgrind: the tests under it are skipped there, and say so.
# shellcheck disable=SC1091
[[ $(. /etc/os-release 2>/dev/null && echo "${VERSION_ID:-}") == 12 ]] && packages+=(oclgrind)

# The same things where there is no dpkg to ask.
commands=(make cmake ninja g++ clang++ llvm-symbolizer pkg-config ccache git blender oiiotool xvfb-run xauth)
headers=(glm/glm.hpp tbb/version.h OpenImageIO/imageio.h pybind11/pybind11.h hwy/highway.h
  CL/opencl.h gtest/gtest.h)

fail() {
  printf 'setup: %s\n' "$@" >&2
  exit 1
}

# Prints the packages of the list that are not installed, one a line.
missing_packages() {
  comm -23 <(printf '%s\n' "${packages[@]}" | sort -u) \
    <(dpkg-query -W -f='${db:Status-Status} ${Package}\n' "${packages[@]}" 2>/dev/null |
      sed -n 's/^installed //p' | sort -u)
}

# Prints the commands, headers and Python parts of the list that are not found, one a line.
missing_parts() {
  local name
  for name in "${commands[@]}"; do
    command -v "$name" >/dev/null || echo "command $name"
  done
  for name in "${headers[@]}"; do
    [[ -e /usr/include/$name || -e /usr/local/include/$name ]] || echo "header $name"
  done
  compgen -G '/usr/include/embree[34]/rtcore.h' >/dev/null || echo 'header embree4/rtcore.h'
  "$python" -c 'import sys; assert sys.version_info[:2] in {(3, 11), (3, 13)}' 2>/dev/null ||
    echo "$python 3.11 or 3.13"
  "$python" -c 'import numpy, venv, ensurepip' 2>/dev/null ||
    echo "numpy, venv and ensurepip of $python"
}

require_debian() {
  local ID=unknown VERSION_ID='' PRETTY_NAME='an unknown system' missing
  # shellcheck disable=SC1091
  [[ -r /etc/os-release ]] && . /etc/os-release
  [[ $ID == debian && ($VERSION_ID == 12 || $VERSION_ID == 13) ]] && return
  missing=$(missing_parts | paste -sd, | sed 's/,/, /g')
  fail "this script sets up Debian 12 and 13 only, and this is $PRETTY_NAME." \
    "missing here: ${missing:-nothing of what this script looks for}." \
    "with that in place, make a venv in .venv with $requirements, then: cmake --preset release && cmake --build build"
}

install_packages() {
  local missing as_root=()
  missing=$(missing_packages | paste -sd' ')
  [[ -z $missing ]] && return
  if [[ $(id -u) != 0 ]]; then
    command -v sudo >/dev/null ||
      fail "neither root nor sudo is here; as root: apt-get install --no-install-recommends $missing"
    as_root=(sudo)
  fi
  echo "setup: installing Debian packages: $missing"
  # shellcheck disable=SC2086  # a list of words
  "${as_root[@]}" apt-get -q update &&
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -y \
      -o DPkg::Lock::Timeout=600 -o Dpkg::Use-Pty=0 install --no-install-recommends $missing >/dev/null ||
    fail "apt-get failed (its reason stands above); still missing: $(missing_packages | paste -sd' ')"
}

# The stamp holds all that the venv depends on, its own place included: a moved venv is broken.
stamp() {
  { "$python" -c 'import sys; print(sys.version)' && pwd && cat "$requirements"; } | sha256sum
}

make_venv() {
  local wanted
  wanted=$(stamp)
  [[ -x .venv/bin/python && $(cat .venv/stamp 2>/dev/null) == "$wanted" ]] && return
  echo "setup: making .venv with $("$python" --version) (bpy is a download of about 350 MB)"
  "$python" -m venv --clear .venv &&
    .venv/bin/python -m pip install --quiet --disable-pip-version-check -r "$requirements" ||
    fail "pip could not install $requirements into .venv (its reason stands above)"
  .venv/bin/python -c 'import bpy' ||
    fail "the bpy module in .venv does not import (its reason stands above)"
  echo "$wanted" >.venv/stamp
}

exec 9<"$requirements" # two set-ups at once would spoil the venv: the second waits
flock 9
require_debian
install_packages
make_venv
