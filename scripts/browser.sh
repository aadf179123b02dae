#!/bin/sh
# Makes sure of a browser for the test of the teaching page.
set -eu
cd "$(dirname "$0")/.."
for name in chromium chromium-browser google-chrome; do
    command -v "$name" >/dev/null 2>&1 && exit 0
done
exec sh scripts/install_packages.sh chromium
