#!/bin/sh
# Install GNU Octave and what the MATLAB twin's pictures and compiled C need, on Debian or Ubuntu.
#   matlab/install-octave.sh           Octave, drawing without a display, a C compiler
#   matlab/install-octave.sh --window  and what opens windows on a machine without a display
set -eu
packages="octave fonts-freefont-otf gnuplot-nox ghostscript octave-dev gcc libc6-dev"
if [ "${1:-}" = --window ]; then
    packages="$packages xvfb xauth"
elif [ $# -gt 0 ]; then
    echo "usage: $0 [--window]" >&2
    exit 2
fi
if ! command -v apt-get >/dev/null; then
    echo "$0: this needs apt-get; elsewhere install Octave 7 or newer by hand" >&2
    exit 1
fi
as_root=
[ "$(id -u)" = 0 ] || as_root=sudo
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -qq
# shellcheck disable=SC2086
$as_root apt-get install -y -qq --no-install-recommends $packages
octave-cli --version | head -n 1
