#!/bin/sh
# Installs Debian packages where that is allowed, and names them where it is not.
set -eu
advice="install the Debian/Ubuntu packages: $* (apt-get install $*), then run make again."

fail() {
    echo "setup: $1; $advice" >&2
    exit 1
}

sudo=""
[ "$(id -u)" = 0 ] || sudo="sudo -n"
command -v apt-get >/dev/null 2>&1 || fail "missing system packages"
[ -z "$sudo" ] || sudo -n true 2>/dev/null || fail "missing system packages"
echo "setup: installing $*"
$sudo apt-get update -qq && $sudo apt-get install -y -qq --no-install-recommends "$@" >/dev/null ||
    fail "could not install them"
