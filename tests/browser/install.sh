#!/bin/sh
# Installs the browser that the pages are tested in, as far as this machine allows. It never fails;
# the tests then say what they lack.
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null && ! command -v chromium >/dev/null; then
    export DEBIAN_FRONTEND=noninteractive
    { apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core; } \
        >/dev/null || echo "test-browser: chromium could not be installed"
fi
exit 0
