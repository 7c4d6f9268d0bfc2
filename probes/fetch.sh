#!/usr/bin/env bash
# Fetch real light probes: the studio-light HDRIs (CC0) of Debian's package blender-data.
#
# usage: fetch.sh [--force]
#
# Needs apt-get with its configured sources, but no root: nothing is installed, and apt's state
# and cache are folders of this run. The probes land in real/ beside this script, all or none.
# When probes are there already nothing is done, unless --force is given: it fetches them again
# and leaves other files in real/ as they are.
set -euo pipefail

package=blender-data

fail() {
    printf 'fetch.sh: %s\n' "$1" >&2
    exit 1
}

# What went wrong, in one line: apt's first complaint in a log, or the log's last line.
reason() {
    grep -m 1 '^[EW]: ' "$1" || tail -n 1 "$1"
}

force=no
case "$#:${1-}" in
    0:) ;;
    1:--force) force=yes ;;
    *)
        printf 'usage: fetch.sh [--force]\n' >&2
        exit 2
        ;;
esac

here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd -P)
target=$here/real

shopt -s nullglob
present=("$target"/*.exr)
if [ "$force" = no ] && [ "${#present[@]}" -gt 0 ]; then
    printf '%d probes are in %s already; --force fetches them again\n' "${#present[@]}" "$target"
    exit 0
fi

command -v apt-get >/dev/null || fail "apt-get is missing; this needs Debian or a descendant of it"
if ! command -v dpkg-deb >/dev/null && ! command -v ar >/dev/null; then
    fail "dpkg-deb and ar are both missing; install one of them to unpack $package"
fi

work=$(mktemp -d -- "$here/.fetch.XXXXXX" 2>/dev/null) || fail "cannot write in $here"
trap 'rm -rf -- "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

mkdir -p -- "$work/lists/partial" "$work/archives/partial" "$work/deb" "$work/tree" "$work/real"
: >"$work/status"
# Hooks of the system's configuration serve the system's own lists and cache, not these.
cat >"$work/apt.conf" <<'CONF'
#clear APT::Update::Pre-Invoke;
#clear APT::Update::Post-Invoke;
#clear APT::Update::Post-Invoke-Success;
CONF
apt=(
    apt-get -q
    # Unlike APT_CONFIG, which is read first, this comes after the system's configuration.
    -c "$work/apt.conf"
    -o "Dir::State=$work"
    -o "Dir::State::lists=$work/lists"
    -o "Dir::State::status=$work/status"
    -o "Dir::Cache=$work"
    -o "Dir::Cache::archives=$work/archives"
    # For root: apt's own user could not enter the temporary folder.
    -o APT::Sandbox::User=root
    -o Acquire::Languages=none
)
export LC_ALL=C

printf 'fetching %s ...\n' "$package" >&2
# One source that fails need not be the one that has the package: the download decides.
"${apt[@]}" update >"$work/update.log" 2>&1 || true
if ! (cd -- "$work/deb" && "${apt[@]}" download "$package") >"$work/log" 2>&1; then
    said=$(grep -m 1 '^[EW]: ' "$work/update.log" || true)
    fail "downloading $package failed: $(reason "$work/log")${said:+ (apt-get update said: $said)}"
fi

debs=("$work"/deb/*.deb)
[ "${#debs[@]}" -eq 1 ] || fail "downloading $package gave ${#debs[@]} files instead of one"
if command -v dpkg-deb >/dev/null; then
    dpkg-deb -x "${debs[0]}" "$work/tree" >"$work/log" 2>&1 ||
        fail "unpacking $package failed: $(reason "$work/log")"
else
    (cd -- "$work/deb" && ar x "${debs[0]}" && tar -xf data.tar.* -C "$work/tree") \
        >"$work/log" 2>&1 || fail "unpacking $package failed: $(reason "$work/log")"
fi

find "$work/tree" -type f -path '*/studiolights/world/*.exr' \
    -exec cp -t "$work/real" -- {} + || fail "copying the probes failed"
found=("$work"/real/*.exr)
[ "${#found[@]}" -gt 0 ] || fail "$package holds no studiolights/world/*.exr"
chmod 755 "$work/real"
chmod 644 "${found[@]}"

if [ -d "$target" ]; then
    mv -f -- "${found[@]}" "$target/" || fail "cannot write in $target"
else
    mv -T -- "$work/real" "$target" || fail "cannot write in $here"
fi
printf '%d probes are in %s\n' "${#found[@]}" "$target"
