#!/usr/bin/env bash
# Builds what a release publishes, from a clean clone of HEAD; what is not committed is not in it.
# With --twice two builds are compared byte for byte. Needs git, cargo and python3 with venv, and the
# network for tools, which go to ${XDG_CACHE_HOME:-~/.cache}/isoform and nowhere else.
set -eu
umask 022
export LC_ALL=C TZ=UTC

usage() {
  cat <<'END'
usage: scripts/release.sh [--output FOLDER] [--parts PART,...] [--std FROM] [--work FOLDER]
                          [--twice]

  --output FOLDER  where the files go (target/release-artifacts)
  --parts LIST     of these, all without it:
                     linux          the program for x86-64 Linux with glibc 2.28 or later
                     wheel          the Python package for the same, any Python from 3.10 on
                     aarch64        the program for 64-bit ARM Linux with glibc 2.28 or later
                     windows        the program for x86-64 Windows
                     sbom           CycloneDX lists of all crates in the program and in the wheel
                     publish-check  cargo publish --dry-run of all crates that are published
  --std FROM       the standard library for aarch64 and windows: `rustup` adds it to the toolchain,
                   `debian` builds it from the source of Debian's package rust-web-src, `auto` (the
                   default) tries them in this order
  --work FOLDER    builds there and leaves all of it for the next time; else in a new folder that
                   is removed at the end
  --twice          builds all parts twice, in two folders, and compares the files

A part that this machine cannot build is left out, with the reason; where parts are named, that is
an error. SHA256SUMS lists the files.
END
}

here=$(cd "$(dirname "$0")/.." && pwd)
# shellcheck source=scripts/venv.sh
. "$here/scripts/venv.sh"
cache=${XDG_CACHE_HOME:-$HOME/.cache}/isoform
cyclonedx=0.5.9
glibc=2.28
all_parts=linux,wheel,aarch64,windows,sbom,publish-check

output=${CARGO_TARGET_DIR:-$here/target}/release-artifacts
parts=$all_parts
std=auto
work=
twice=false
while [ $# -gt 0 ]; do
  case $1 in
    --output) output=$2 && shift 2 ;;
    --parts) parts=$2 && shift 2 ;;
    --std) std=$2 && shift 2 ;;
    --work) work=$2 && shift 2 ;;
    --twice) twice=true && shift ;;
    --help) usage && exit ;;
    *) usage >&2 && exit 2 ;;
  esac
done
for part in ${parts//,/ }; do
  case ,$all_parts, in
    *",$part,"*) ;;
    *) printf 'there is no part %s\n' "$part" >&2 && exit 2 ;;
  esac
done

say() { printf '\n== %s\n' "$*" >&2; }

if $twice; then
  [ -z "$work" ] || { printf 'either --work or --twice\n' >&2 && exit 2; }
  again=$(mktemp -d)
  trap 'rm -rf "$again"' EXIT
  "$0" --output "$output" --parts "$parts" --std "$std"
  "$0" --output "$again" --parts "$parts" --std "$std"
  say "both builds"
  (cd "$output" && sha256sum --check "$again/SHA256SUMS") && printf 'the same bytes\n'
  exit
fi

if [ -n "$work" ]; then
  mkdir -p "$work"
  rm -rf "$work/src"
else
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
work=$(cd "$work" && pwd -P)
mkdir -p "$output"
output=$(cd "$output" && pwd -P)

# A clean clone, and whatever would tell one build from another.
commit=$(git -C "$here" rev-parse HEAD)
git clone --quiet --no-tags "$here" "$work/src"
cd "$work/src"
git checkout --quiet --detach "$commit"
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
export CARGO_INCREMENTAL=0 CARGO_PROFILE_RELEASE_STRIP=symbols
export CARGO_TARGET_DIR=$work/target
unset RUSTFLAGS
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
say "isoform $version, commit $commit"

# flags SYSROOT [FLAG...]: what rustc is told: none of the folders here are named in what it makes.
flags() {
  local sysroot=$1 home=${CARGO_HOME:-$HOME/.cargo} list folder
  shift
  list="--remap-path-prefix=$work=build"
  list+=$'\x1f'"--remap-path-prefix=$work/src=isoform-$version"
  list+=$'\x1f'"--remap-path-prefix=$sysroot/lib/rustlib/src/rust=rust"
  for folder in "$home"/registry/src/*/; do
    list+=$'\x1f'"--remap-path-prefix=${folder%/}=crates"
  done
  for folder; do list+=$'\x1f'$folder; done
  printf '%s' "$list"
}

# Tools from PyPI.
python_tools() {
  make_venv scripts/requirements-release.txt
  export PATH=$venv/bin:$PATH
}

# zip_folder FOLDER ARCHIVE: files in the order of their names, with one time.
zip_folder() {
  python3 - "$@" <<'END'
import pathlib, sys, zipfile
folder, archive = map(pathlib.Path, sys.argv[1:])
with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as out:
    for file in sorted(folder.iterdir()):
        entry = zipfile.ZipInfo(f"{folder.name}/{file.name}")
        entry.external_attr = 0o644 << 16
        entry.compress_type = zipfile.ZIP_DEFLATED
        out.writestr(entry, file.read_bytes())
END
}

# pack NAME TARGET PROGRAM: an archive of the program with what belongs to it.
pack() {
  local name=$1 target=$2 program=$3 folder=$work/pack/$1
  rm -rf "$folder"
  mkdir -p "$folder"
  cp "$program" README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$folder"
  python3 scripts/third_party.py isoform-cli "$target" > "$folder/THIRD-PARTY.txt"
  case $program in
    *.exe) zip_folder "$folder" "$output/$name.zip" ;;
    *)
      tar --directory "$work/pack" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --format=ustar \
        --owner=0 --group=0 --numeric-owner --mode=u+rwX,go+rX,go-w --create "$name" |
        gzip -n -9 > "$output/$name.tar.gz"
      ;;
  esac
}

# newest_glibc FILE: the newest version of glibc that its symbols ask for.
newest_glibc() { objdump -T "$1" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -n 1; }

build_linux() {
  local target=x86_64-unknown-linux-gnu program newest
  python_tools
  CARGO_ENCODED_RUSTFLAGS=$(flags "$(rustc --print sysroot)") \
    cargo zigbuild --release --locked -p isoform-cli --target "$target.$glibc"
  program=$CARGO_TARGET_DIR/$target/release/isoform
  newest=$(newest_glibc "$program")
  say "$program asks for $newest"
  [ "$(printf 'GLIBC_%s\n%s\n' "$glibc" "$newest" | sort -V | tail -n 1)" = "GLIBC_$glibc" ]
  pack "isoform-$version-x86_64-linux" "$target" "$program"
}

build_wheel() {
  local target=x86_64-unknown-linux-gnu tag=manylinux_${glibc/./_} wheel
  python_tools
  # The notices of what is linked into it are part of it.
  python3 scripts/third_party.py isoform-py "$target" > THIRD-PARTY.txt
  sed -i 's/"LICENSE-APACHE"\]/"LICENSE-APACHE", "THIRD-PARTY.txt"]/' pyproject.toml
  rm -f "$work"/wheel/*
  CARGO_ENCODED_RUSTFLAGS=$(flags "$(rustc --print sysroot)") \
    maturin build --release --locked --zig --target "$target" --compatibility "$tag" \
    --out "$work/wheel"
  git checkout --quiet pyproject.toml && rm THIRD-PARTY.txt
  wheel=$(echo "$work"/wheel/*.whl)
  auditwheel show "$wheel" | tee /dev/stderr | tr '\n' ' ' > "$work/auditwheel"
  grep -q "\"manylinux_2_\(5\|1.\|2[0-8]\)_x86_64\"" "$work/auditwheel"
  cp "$wheel" "$output"
}

# The standard library of a target, from rustup: true if it is there.
from_rustup() {
  command -v rustup >/dev/null || return 1
  rustup target list --installed | grep -qx "$1" || rustup target add "$1"
}

# Debian's newest Rust with the source of its standard library, apart from all else: true if it is
# new enough and came. `rust` is its folder.
from_debian() {
  local minimum newest packages file
  command -v apt-get >/dev/null || return 1
  minimum=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
  newest=$(apt-cache policy rust-web-src | sed -n 's/^ *Candidate: //p')
  dpkg --compare-versions "${newest:-0}" ge "$minimum" || return 1
  rust=$cache/rust-web-$newest
  if [ -e "$rust/complete" ]; then return; fi
  # Those of its packages that are missing here, without their scripts.
  packages=$(apt-get install --simulate --no-install-recommends rustc-web cargo-web rust-web-src |
    sed -n 's/^Inst \([^ ]*\).*/\1/p')
  mkdir -p "$rust"
  # shellcheck disable=SC2086
  (cd "$rust" && apt-get download --quiet $packages) >&2 || return 1
  for file in "$rust"/*.deb; do dpkg -x "$file" "$rust" || return 1; done
  rm "$rust"/*.deb
  touch "$rust/complete"
}

# std_of TARGET: where its standard library comes from, false where it does not.
std_of() {
  if [ "$std" != debian ] && from_rustup "$1"; then
    echo rustup
  elif [ "$std" != rustup ] && from_debian; then
    echo "$rust"
  else
    return 1
  fi
}

# cross COMMAND TARGET [GLIBC [FLAG...]]: the program for another kind of machine.
cross() {
  local command=$1 target=$2 suffix=$3 from
  shift 3
  from=$(std_of "$target")
  if [ "$from" = rustup ]; then
    CARGO_ENCODED_RUSTFLAGS=$(flags "$(rustc --print sysroot)" "$@") \
      cargo "$command" --release --locked -p isoform-cli --target "$target$suffix"
    return
  fi
  # cargo asks for features that are not stable; the program does not.
  (
    export PATH=$from/usr/bin:$PATH LD_LIBRARY_PATH=$from/usr/lib/x86_64-linux-gnu
    export RUSTC=$from/usr/bin/rustc RUSTC_BOOTSTRAP=1
    CARGO_ENCODED_RUSTFLAGS=$(flags "$from/usr" "$@") \
      cargo "$command" --release --locked -p isoform-cli --target "$target$suffix" \
      -Z build-std=std,panic_unwind
  )
}

build_aarch64() {
  local target=aarch64-unknown-linux-gnu
  python_tools
  cross zigbuild "$target" ".$glibc"
  pack "isoform-$version-aarch64-linux" "$target" \
    "$CARGO_TARGET_DIR/$target/release/isoform"
}

build_windows() {
  local target=x86_64-pc-windows-gnu
  export CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER=x86_64-w64-mingw32-gcc
  cross build "$target" "" -Clink-arg=-Wl,--no-insert-timestamp
  pack "isoform-$version-x86_64-windows" "$target" \
    "$CARGO_TARGET_DIR/$target/release/isoform.exe"
}

build_sbom() {
  local tools=$cache/tools-cyclonedx-$cyclonedx package file
  if [ ! -x "$tools/bin/cargo-cyclonedx" ]; then
    CARGO_PROFILE_RELEASE_STRIP=none cargo install --locked --quiet --root "$tools" \
      "cargo-cyclonedx@$cyclonedx"
  fi
  for package in isoform-cli isoform-py; do
    "$tools/bin/cargo-cyclonedx" cyclonedx --manifest-path "crates/$package/Cargo.toml" \
      --target x86_64-unknown-linux-gnu --format json --spec-version 1.5 --quiet
    file=$output/isoform-$version-${package#isoform-}.cdx.json
    sed "s|$work/src|.|g" "crates/$package/$package.cdx.json" > "$file"
  done
  find crates -name '*.cdx.json' -delete
}

build_publish_check() {
  cargo publish --workspace --dry-run --locked
}

# build PART
build() {
  case $1 in
    linux) build_linux ;;
    wheel) build_wheel ;;
    aarch64) build_aarch64 ;;
    windows) build_windows ;;
    sbom) build_sbom ;;
    publish-check) build_publish_check ;;
  esac
}

# why_not PART: why this machine cannot build it; nothing if it can.
why_not() {
  local no_std="neither rustup nor Debian has its standard library here (see --std)"
  case $1 in
    linux | wheel)
      [ "$(uname -sm)" = "Linux x86_64" ] || echo "it is built on x86-64 Linux"
      ;;
    aarch64) std_of aarch64-unknown-linux-gnu >/dev/null || echo "$no_std" ;;
    windows)
      std_of x86_64-pc-windows-gnu >/dev/null || echo "$no_std"
      command -v x86_64-w64-mingw32-gcc >/dev/null ||
        echo "x86_64-w64-mingw32-gcc is missing (Debian: gcc-mingw-w64-x86-64)"
      ;;
  esac
}

main() {
  local part start reason status left_out=() failed=()
  cargo fetch --locked
  for part in ${parts//,/ }; do
    say "$part"
    start=$SECONDS
    reason=$(why_not "$part")
    if [ -z "$reason" ]; then
      # In a shell of its own, which ends at the first failure (within `if` it would not).
      set +e
      (set -e; build "$part")
      status=$?
      set -e
      if [ $status -ne 0 ]; then failed+=("$part"); fi
    else
      left_out+=("$part: $reason")
    fi
    say "$part: $((SECONDS - start)) s"
  done

  (cd "$output" && sha256sum isoform-* > "$work/SHA256SUMS" && mv "$work/SHA256SUMS" .)
  say "$output"
  cat "$output/SHA256SUMS"
  if [ ${#left_out[@]} -gt 0 ]; then printf 'left out: %s\n' "${left_out[@]}" >&2; fi
  if [ ${#failed[@]} -gt 0 ]; then printf 'failed: %s\n' "${failed[@]}" >&2; fi
  [ ${#failed[@]} -eq 0 ] || exit 1
  [ ${#left_out[@]} -eq 0 ] || [ "$parts" = "$all_parts" ] || exit 1
}
# The last line that is read: a change of this file meanwhile does no harm.
main; exit
