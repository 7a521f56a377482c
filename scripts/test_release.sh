#!/usr/bin/env bash
# Tries the files that scripts/release.sh made where there is nothing else: the program and the
# wheel in empty roots of older Debians without a compiler, and the programs for other machines in
# their emulators. Needs root, debootstrap, python3 with pip, and the network for packages.
#
#   scripts/test_release.sh [FOLDER [SUITE...]]
#
# The program is tried in the oldest of the suites that can be had (buster, bullseye, bookworm), the
# wheel in bookworm, whose Python it takes.
set -eu
umask 022

here=$(cd "$(dirname "$0")/.." && pwd)
folder=$(cd "${1:-${CARGO_TARGET_DIR:-$here/target}/release-artifacts}" && pwd)
suites=("${@:2}")
if [ ${#suites[@]} -eq 0 ]; then suites=(buster bullseye bookworm); fi
cache=${XDG_CACHE_HOME:-$HOME/.cache}/isoform
# shellcheck source=tests/harness/lib.sh
. "$here/tests/harness/lib.sh"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch" "$logs"' EXIT

# root SUITE [PACKAGE...]: an empty root of Debian in $scratch/SUITE, false where there is none.
# What debootstrap made is kept for the next time.
root() {
  local suite=$1 packages kept
  shift
  packages=$(IFS=, && printf '%s' "$*")
  kept=$cache/root-$suite-${packages:-none}.tar
  if [ ! -e "$kept" ]; then
    mkdir -p "$cache"
    debootstrap --variant=minbase ${packages:+"--include=$packages"} "$suite" "$scratch/$suite" \
      > "$scratch/$suite.log" 2>&1 || {
      tail -n 2 "$scratch/$suite.log"
      rm -rf "${scratch:?}/$suite"
      return 1
    }
    tar --directory "$scratch/$suite" --create --file "$kept.new" . && mv "$kept.new" "$kept"
    rm -rf "${scratch:?}/$suite"
  fi
  mkdir "$scratch/$suite"
  tar --directory "$scratch/$suite" --extract --file "$kept"
}
# inside SUITE COMMAND...: in its root, with nothing of this machine's environment.
inside() {
  local root=$scratch/$1
  shift
  chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/local/bin:/usr/bin:/bin \
    LC_ALL=C.UTF-8 sh -ec 'cd /root && exec "$@"' sh "$@"
}
no_compiler() {
  # shellcheck disable=SC2016
  inside "$1" sh -c '
    for tool in cc gcc clang rustc cargo; do
      if command -v "$tool"; then exit 1; fi
    done
    ldd --version | head -n 1'
}
is_report() { [ -s "$1/isoform-recover/cup/report.html" ] && ls -l "$1/isoform-recover/cup"; }

program_in() {
  local suite=$1 archive=$2
  tar --directory "$scratch/$suite/usr/local/bin" --strip-components=1 --extract --file "$archive" \
    --no-same-owner --wildcards '*/isoform'
  inside "$suite" isoform --version && inside "$suite" isoform recover -q &&
    is_report "$scratch/$suite/root"
}

wheel_in() {
  local suite=$1 wheel=$2 root=$scratch/$1
  # numpy as pip of that root would take it; the root itself needs no network.
  python3 -m pip download --quiet --disable-pip-version-check --only-binary=:all: \
    --python-version 3.11 --platform manylinux_2_28_x86_64 --platform manylinux_2_17_x86_64 \
    --dest "$root/root/wheels" 'numpy>=1.26'
  cp "$wheel" "$root/root/wheels"
  inside "$suite" python3 -m pip install --quiet --break-system-packages --no-index \
    --root-user-action=ignore --find-links wheels isoform
}
tour_in() {
  local suite=$1
  cp "$here/docs/python.md" "$scratch/$suite/root"
  cat > "$scratch/$suite/root/tour.py" <<'END'
import re

# The rest of the page takes packages beside numpy.
page = open("python.md").read().split("\n## Fleets\n")[0]
blocks = re.findall(r"^```python\n(.*?)^```", page, re.M | re.S)
names = {}
for block in blocks:
    exec(compile(block, "python.md", "exec"), names)
print(len(blocks), "blocks of Python")
END
  inside "$suite" python3 tour.py && ls -l "$scratch/$suite/root/ball.msh"
}

check "the sums hold" sh -c "cd '$folder' && sha256sum --check SHA256SUMS"

for archive in "$folder"/isoform-*-x86_64-linux.tar.gz; do
  [ -e "$archive" ] || continue
  for suite in "${suites[@]}"; do
    say "the program in $suite"
    if root "$suite"; then
      check "no compiler in $suite" no_compiler "$suite"
      check "isoform recover in $suite" program_in "$suite" "$archive"
      rm -rf "${scratch:?}/$suite"
      break
    fi
    printf 'skip  there is no %s\n' "$suite"
  done
done

for wheel in "$folder"/isoform-*-manylinux_*_x86_64.whl; do
  [ -e "$wheel" ] || continue
  say "the wheel in bookworm"
  if root bookworm python3 python3-pip; then
    check "no compiler in bookworm" no_compiler bookworm
    check "pip install in bookworm" wheel_in bookworm "$wheel"
    check "the tour in Python" tour_in bookworm
    rm -rf "$scratch/bookworm"
  else
    printf 'skip  there is no bookworm\n'
  fi
done

# Programs for other machines: whole paths lead from their emulators to this one's files.
emulated() {
  local name=$1
  shift
  mkdir -p "$scratch/$name"
  (cd "$scratch/$name" && "$@" recover -q) && is_report "$scratch/$name"
}
for archive in "$folder"/isoform-*-aarch64-linux.tar.gz; do
  [ -e "$archive" ] || continue
  say "the program for ARM"
  if [ -d /usr/aarch64-linux-gnu/lib ] && command -v qemu-aarch64-static >/dev/null; then
    tar --directory "$scratch" --extract --file "$archive"
    check "isoform recover in qemu" emulated arm qemu-aarch64-static -L /usr/aarch64-linux-gnu \
      "$scratch/$(basename "$archive" .tar.gz)/isoform"
  else
    printf 'skip  qemu-user-static or libc6-arm64-cross is missing\n'
  fi
done
# The part of Windows that Rust's standard library takes its random numbers from, and that wine
# before 9 does not have.
random_numbers() {
  cat > "$scratch/random.c" <<'END'
#include <windows.h>
#include <ntsecapi.h>
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T size) {
  return RtlGenRandom(data, (ULONG)size);
}
END
  x86_64-w64-mingw32-gcc -shared -o "$1/bcryptprimitives.dll" "$scratch/random.c" -ladvapi32
}
for archive in "$folder"/isoform-*-x86_64-windows.zip; do
  [ -e "$archive" ] || continue
  say "the program for Windows"
  wine=$(command -v wine64 || command -v wine || ls /usr/lib/wine/wine64 2>/dev/null || true)
  if [ -n "$wine" ]; then
    python3 -m zipfile -e "$archive" "$scratch"
    if command -v x86_64-w64-mingw32-gcc >/dev/null; then
      random_numbers "$scratch/$(basename "$archive" .zip)"
    fi
    check "isoform recover in wine" emulated wine env WINEDEBUG=-all WINEPREFIX="$scratch/prefix" \
      "$wine" "$scratch/$(basename "$archive" .zip)/isoform.exe"
  else
    printf 'skip  wine is missing\n'
  fi
done

# The sums alone try nothing.
if [ "$passed" -le 1 ]; then bad "no program and no wheel is tried"; fi
finish
