#!/bin/sh
# Prepares a bare machine: system libraries, .venv, the pinned packages and pepper_drake itself.
set -eu
cd "$(dirname "$0")/.."
PYTHON=${PYTHON:-python3}

fail() {
    echo "setup: $1" >&2
    exit 1
}

command -v "$PYTHON" >/dev/null 2>&1 || fail "no $PYTHON found; install Python 3.11 or newer."
"$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    fail "$("$PYTHON" --version) is too old; install Python 3.11 or newer and say PYTHON=python3.11."

# Drake needs glib to import, and EGL with a software driver to render its cameras.
missing=""
for pair in libglib-2.0.so.0:libglib2.0-0 libEGL.so.1:libegl1; do
    /sbin/ldconfig -p 2>/dev/null | grep -q "${pair%%:*}" || missing="$missing ${pair##*:}"
done
find /usr/lib /usr/lib64 -name 'swrast_dri.so' -o -name 'libgallium*.so' 2>/dev/null | grep -q . ||
    missing="$missing libgl1-mesa-dri"
[ -z "$missing" ] || sh scripts/install_packages.sh $missing || exit 1

[ -x .venv/bin/python ] || "$PYTHON" -m venv .venv ||
    fail "could not make .venv; install the Debian/Ubuntu package python3-venv."
echo "setup: installing the Python packages into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check \
    --constraint constraints.txt --editable '.[dev]' ||
    fail "pip could not install the packages; see its message above."
