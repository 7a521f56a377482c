#!/usr/bin/env bash
# Builds the program for browsers, target/wasm/isoform.wasm: the binary for WASI, which
# web/src/wasm/program.ts runs with files in memory.
#
#   scripts/wasm.sh
#
# Where npm is installed it also makes target/wasm/studio.html: Isoform Studio with the program in one
# file.
#
# The compiler, the sources of its standard library, the C library and the linker are Debian's:
#
#   apt-get install --no-install-recommends rustc-web cargo-web rust-web-src wasi-libc lld
#
# The module has no threads. It uses vectors of 128 bits and exceptions, as browsers have had them
# since 2023.
set -eu
cd "$(dirname "$0")/.."

libc=/usr/lib/wasm32-wasi
source=/usr/lib/rustlib/src/rust/library/std
for path in /usr/bin/cargo /usr/bin/rustc /usr/bin/wasm-ld "$source" "$libc/crt1-command.o"; do
  if [ ! -e "$path" ]; then
    printf '%s is missing: apt-get install --no-install-recommends %s\n' "$path" \
      'rustc-web cargo-web rust-web-src wasi-libc lld' >&2
    exit 2
  fi
done
out=${CARGO_TARGET_DIR:-$PWD/target}/wasm
mkdir -p "$out"
# What this C library lacks and the module imports: MISSING in program.ts has it.
printf '%s\n' __cpp_exception pthread_attr_init pthread_attr_setstacksize pthread_attr_destroy \
  pthread_create pthread_detach pthread_join realpath >"$out/missing.txt"
# Trees of deeply nested models are walked by recursion: the stack is that of native threads.
flags=(
  -C linker-flavor=wasm-ld
  -C link-self-contained=no
  -L "native=$libc"
  -C "link-arg=$libc/crt1-command.o"
  -C "link-arg=--allow-undefined-file=$out/missing.txt"
  -C link-arg=-zstack-size=8388608
  -C target-feature=+simd128
  # A panic is a failure of its stage, as in the native program.
  -C panic=unwind
  "--remap-path-prefix=$PWD=isoform"
  "--remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo"
)
# A toolchain of rustup, if there is one, has no sources of this standard library.
export PATH="/usr/bin:$PATH" CARGO=/usr/bin/cargo RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1
unset RUSTUP_TOOLCHAIN
export CARGO_TARGET_WASM32_WASIP1_LINKER=wasm-ld
CARGO_ENCODED_RUSTFLAGS=$(IFS=$'\x1f' && printf '%s' "${flags[*]}")
export CARGO_ENCODED_RUSTFLAGS
export CARGO_PROFILE_RELEASE_STRIP=true
cargo build --locked --release -Z build-std=std,panic_unwind --target wasm32-wasip1 \
  --target-dir "$out" --package isoform-cli
cp "$out/wasm32-wasip1/release/isoform.wasm" "$out/isoform.wasm"
printf '%s: %s bytes, %s with gzip -9\n' "$out/isoform.wasm" "$(wc -c <"$out/isoform.wasm")" \
  "$(gzip -9 -c "$out/isoform.wasm" | wc -c)"
if command -v npm >/dev/null; then
  (cd web && npm ci --silent --no-audit --no-fund && node offline.mjs "$out/isoform.wasm" "$out/studio.html")
fi
