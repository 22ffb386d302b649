#!/usr/bin/env bash
# Make .venv with uwsim and its development tools, and see to the system libraries it needs. Never asks a question.
# PYTHON=/path/to/python chooses the interpreter. A second run does nothing unless pyproject.toml changed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

venv=.venv
stamp=$venv/.setup-stamp

say() { printf 'setup: %s\n' "$*"; }
stop() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

in_range() {
    "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1
}

find_python() {
    local name
    if [ -n "${PYTHON:-}" ]; then
        in_range "$PYTHON" && command -v "$PYTHON"
        return
    fi
    # the system's own first: it is the one that apt can add a missing venv module to
    for name in python3 python3.13 python3.12 python3.11 /usr/bin/python3; do
        if in_range "$name"; then
            command -v "$name"
            return
        fi
    done
    return 1
}

# The way to become root without a question: nothing for root, sudo where it asks for no password, else fail.
as_root() {
    if [ "$(id -u)" = 0 ]; then
        echo env
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        echo sudo -n
    else
        return 1
    fi
}

# The command that a person would type for an apt package.
apt_command() {
    local sudo=""
    [ "$(id -u)" = 0 ] || sudo="sudo "
    echo "${sudo}apt-get update && ${sudo}apt-get install -y $*"
}

apt_install() {
    local root
    command -v apt-get >/dev/null && root=$(as_root) || return 1
    say "apt-get install $*"
    if ! $root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y "$@" </dev/null >/dev/null 2>&1; then
        $root env DEBIAN_FRONTEND=noninteractive apt-get update -qq </dev/null || return 1
        $root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y "$@" </dev/null >/dev/null || return 1
    fi
}

have_venv() { "$1" -c 'import ensurepip, venv' >/dev/null 2>&1; }

make_venv() {
    local python package
    if ! python=$(find_python); then
        [ -z "${PYTHON:-}" ] || stop "PYTHON: got $PYTHON, allowed: Python 3.11 to 3.13"
        apt_install python3 python3-venv || stop "no Python 3.11 to 3.13; type: $(apt_command python3 python3-venv)"
        python=$(find_python) || stop "no Python 3.11 to 3.13 on this machine, and apt has none; install one"
    fi
    if ! have_venv "$python"; then
        package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
        apt_install "$package" || stop "$python has no venv module; type: $(apt_command "$package")"
        have_venv "$python" || stop "$python has no venv module, not even with the package $package"
    fi
    say "making $venv with $python"
    rm -rf "$venv"
    "$python" -m venv "$venv"
}

# What the installed state depends on: the dependencies, this place, and the interpreter behind .venv.
fingerprint() {
    echo "$PWD"
    sha256sum pyproject.toml
    "$venv/bin/python" -c 'import sys; print(sys.version)'
}

see_to_libraries() {
    local line remedy
    if line=$("$venv/bin/python" -m uwsim.render.llvm); then
        say "$line"
        return
    fi
    remedy=$("$venv/bin/python" -m uwsim.render.llvm --remedy)
    case "$remedy" in
    *"apt-get install -y "*)
        # shellcheck disable=SC2086 # one or two package names
        apt_install ${remedy##*apt-get install -y } || stop "$line"
        line=$("$venv/bin/python" -m uwsim.render.llvm) || stop "$line"
        say "$line"
        ;;
    *) stop "$line" ;;
    esac
}

if ! in_range "$venv/bin/python" || ! "$venv/bin/python" -c 'import pip' 2>/dev/null; then
    make_venv
elif [ -s "$stamp" ] && [ "$(head -n 1 "$stamp")" != "$PWD" ]; then
    make_venv # the tree was moved or copied: the scripts in .venv name the old place
fi
if [ "$(cat "$stamp" 2>/dev/null)" != "$(fingerprint)" ]; then
    say "installing uwsim and its dependencies into $venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --editable '.[dev,cluster,denoise]' </dev/null
    fingerprint >"$stamp"
fi
see_to_libraries
