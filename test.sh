#!/usr/bin/env bash
# Runs the checks of this repository, says how many hold, and what each step took. Needs cargo and,
# for the acceptance checks, python3 with venv.
#
#   ./test.sh          what guards each claim once, tests/acceptance.txt; some seventeen minutes
#   ./test.sh --full   all of it; hours
#
# With CI=true whatever is missing is a failure, not a skip. The acceptance checks and the data that
# is too large for the repository lie beside it in ../shared, or where ISOFORM_SHARED says.
set -u
cd "$(dirname "$0")" || exit 2

extent=part
case "$*" in
  "") ;;
  --full) extent=whole ;;
  *) printf 'usage: %s [--full]\n' "$0" >&2; exit 2 ;;
esac
# shellcheck source=tests/harness/lib.sh
. tests/harness/lib.sh
# shellcheck source=scripts/venv.sh
. scripts/venv.sh
# Checks that fail and are known to, each with its reason. One that passes is a failure, so that the list shrinks.
expected_failures=tests/expected_failures.txt
scratch=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null; rm -rf "$scratch" "$logs"' EXIT
shared=${ISOFORM_SHARED:-../shared}
checks=$shared/checks

# debian COMMAND PACKAGE...: installs packages where the command is missing and we may.
debian() {
  local command=$1
  shift
  if command -v "$command" >/dev/null; then return; fi
  if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends "$@"; } >/dev/null 2>&1
  fi
}
# environment NAME: sets `venv` to an environment of Python, and makes it unless it is there. The two
# packages that CAD programs are written for ask for different versions of one library.
environment() {
  local files
  case $1 in
    package)
      files=(crates/isoform-py/tests/requirements.txt)
      # Ray is large, and is tried with --full alone.
      if [ "$extent" = whole ]; then files+=(crates/isoform-py/tests/requirements-full.txt); fi
      ;;
    checks) files=("$checks/requirements.txt" tests/harness/requirements.txt) ;;
    view) files=("$checks/requirements-view.txt") ;;
    *) files=("tests/harness/$1.txt") ;;
  esac
  make_venv "${files[@]}"
}
# fetch: what the steps below ask for and this machine has not, while the code is compiled.
fetch() {
  local name names=(package build123d cadquery)
  debian openscad openscad
  if [ "$extent" = whole ]; then debian valgrind valgrind; fi
  if [ -d "$checks" ]; then
    names+=(checks view)
    debian chromium chromium
    debian ccx calculix-ccx
  fi
  for name in "${names[@]}"; do environment "$name"; done
  # gmsh's wheel needs libraries of a desktop.
  if [ -d "$checks" ] && environment checks && ! "$venv/bin/python" -c 'import gmsh' 2>/dev/null; then
    debian libglu1-mesa libglu1-mesa libxcursor1 libxft2 libxinerama1
  fi
}
fetching=
if command -v python3 >/dev/null; then
  fetch >/dev/null 2>&1 &
  fetching=$!
fi

# Two steps run at a time, and threads of linear algebra that wait for one another waste both cores.
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1

# ---- the code -----------------------------------------------------------------------------------

# One build of everything gains nothing from incremental files, which fill half of target/.
if [ "${CI:-}" = true ]; then export CARGO_INCREMENTAL=0; fi
# Tests themselves are compiled with little optimisation.
export RUSTC_WRAPPER="${RUSTC_WRAPPER:-$PWD/tests/harness/rustc.sh}"
export RUSTDOC="${RUSTDOC:-$PWD/tests/harness/rustdoc.sh}"

check "harness" tests/harness/self_test.sh

if ! command -v cargo >/dev/null; then
  printf 'cargo is missing; https://rustup.rs installs it\n'
  bad "cargo is missing"
  finish
fi
for component in rustfmt clippy; do
  if ! cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1; then
    command -v rustup >/dev/null && rustup component add "$component" >/dev/null 2>&1
  fi
done
# The viewer that pages embed is what its sources build; beside the compiler, which has both cores.
if command -v npm >/dev/null; then
  viewer() { cd web && npm ci --silent --no-audit --no-fund && npm run --silent check && npm test --silent && npm run --silent build -- --check; }
  later check "viewer" viewer
else
  missing npm
fi
if cargo fmt --version >/dev/null 2>&1; then
  # fuzz and benches/peers are workspaces of their own, whose dependencies are those of the first.
  format() { cargo fmt --all --check && cargo fmt --check --manifest-path fuzz/Cargo.toml && cargo fmt --check --manifest-path benches/peers/Cargo.toml; }
  check "format" format
else
  missing rustfmt
fi
# Property tests draw one set of cases, so that a change is judged by itself; --full draws new ones.
# The tests that take many seconds take few cases, but with --full.
if [ "$extent" = part ]; then
  export PROPTEST_RNG_SEED="${PROPTEST_RNG_SEED:-20261125}"
else
  export ISOFORM_FULL=1
fi
# Unit and property tests, the command line, who may use whom, the fuzzing corpus replayed, and the
# examples in the documentation: all in the profile of the release, so that libraries, program and
# Python package are compiled once. The tools of this repository apart, since they ask for other
# features of foreign crates.
products=(--workspace --exclude isoform-docs --exclude isoform-measure)
tools=(-p isoform-docs -p isoform-measure)
if cargo clippy --version >/dev/null 2>&1; then export CLIPPY_ARGS=-Wwarnings; else missing clippy; fi
# The compiler and clippy say nothing.
compiles() {
  ! { cargo test --release "${products[@]}" --locked --no-run --quiet 2>&1 &&
    cargo test --release "${tools[@]}" --locked --no-run --quiet 2>&1 &&
    cargo build --release "${tools[@]}" --locked --bins --quiet 2>&1; } | grep .
}
check "compilation and lints" compiles
if [ "$extent" = whole ]; then
  # What the steps above have not compiled: documentation of programs, all targets by themselves.
  check "all lints" env -u RUSTC_WRAPPER cargo clippy --release --workspace --all-targets --locked --quiet -- -D warnings
  check "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --release --workspace --no-deps --locked --quiet
  tests "tests with assertions" cargo test "${products[@]}" --locked --no-fail-fast
  # Tests that take minutes each.
  tests "random maps" cargo test --release --locked -p isoform --test it random_maps:: -- --ignored
fi

binary=${CARGO_TARGET_DIR:-target}/release/isoform
if [ ! -x "$binary" ]; then
  settle
  bad "there is no program to check"
  finish
fi
binary=$(realpath "$binary")
folder=${binary%/*}
tests "tests" cargo test --release "${products[@]}" --locked --no-fail-fast
if [ -n "$fetching" ]; then wait "$fetching"; fi

# ---- the program --------------------------------------------------------------------------------

if [ "$extent" = whole ]; then
  if command -v valgrind >/dev/null; then check "instructions" python3 benches/instructions.py "$binary"; else missing valgrind; fi
fi
# The Python package: a wheel as pip makes it, its tests, and the types that it tells.
python_package() {
  local venv python wheel=$scratch/wheel
  if ! environment package; then
    missing "a python environment for the package"
    return
  fi
  python=$venv/bin/python
  make_wheel() {
    "$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$wheel" . &&
      "$python" -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall "$wheel"/*.whl
  }
  check "python: wheel" make_wheel
  # They press Ctrl-C, which bash makes steps in the background ignore.
  later check "python: tests" env --default-signal=INT "$python" -B -m unittest discover --quiet --start-directory crates/isoform-py/tests
  later check "python: types" "$python" -m mypy --strict --cache-dir "$scratch/mypy" crates/isoform-py/python/isoform
  accept_with "$python" accept_python
}

# CAD programs that are written run where they are meant to.
cad_programs() {
  local venv dialect
  for dialect in build123d cadquery; do
    if environment "$dialect"; then
      later check "programs for $dialect" "$venv/bin/python" -B tests/cad_programs.py "$dialect" "$binary"
    else
      missing "a python environment for $dialect"
    fi
  done
  if command -v openscad >/dev/null; then later check "programs for OpenSCAD" python3 -B tests/cad_programs.py openscad "$binary"; else missing openscad; fi
}

# ---- acceptance ---------------------------------------------------------------------------------

# accept_with PYTHON SUITE: the runs of an acceptance script that tests/acceptance.txt lists, with
# the answer to Ctrl-C that programs in the foreground have.
accept_with() {
  local python=$1 wanted=$2 kind suite arguments words
  [ -d "$checks" ] || return
  while IFS='|' read -r kind suite arguments _; do
    kind=${kind// /} suite=${suite// /}
    [ "$kind" = "$extent" ] && [ "$suite" = "$wanted" ] || continue
    read -ra words <<<"${arguments//\{fewer\}/$scratch/fewer}"
    later accept "$suite ${words[*]/$scratch\//}" "$suite" "$kind" env --default-signal=INT "$python" "$checks/$suite.py" "${words[@]}" --isoform "$binary"
  done <tests/acceptance.txt
}
acceptance() {
  local venv python suite
  environment checks
  python=$venv/bin/python
  if ! "$python" -c 'import gmsh' 2>/dev/null; then
    missing "a python environment with $checks/requirements.txt"
    return
  fi
  if [ "$extent" = part ]; then
    check "fewer cases" "$python" tests/harness/fewer_cases.py tests/acceptance.txt "$shared" "$scratch/fewer"
  fi
  pages
  for suite in mesh trust implicitize recognize reports fit rational brep patch hyperfun; do
    accept_with "$python" "accept_$suite"
  done
  solvers "$python"
}

# Pages in a real browser and pictures without one, with python packages of their own.
pages() {
  local venv
  if ! environment view; then
    missing "a python environment with playwright"
  elif ! command -v chromium >/dev/null; then
    missing chromium
  else
    browser() { cd web && ISOFORM=$binary CHROMIUM=$(command -v chromium) npm run --silent browser; }
    if [ -d web/node_modules ]; then later check "pages in a browser" browser; else missing npm; fi
    accept_with "$venv/bin/python" accept_view
    if [ "$extent" = whole ]; then webassembly; fi
  fi
}

# The program as WebAssembly gives the bytes of the native one, and the studio works as one file.
webassembly() {
  debian /usr/bin/rustc rustc-web cargo-web rust-web-src wasi-libc lld
  module() { scripts/wasm.sh && cd web && ISOFORM=$binary CHROMIUM=$(command -v chromium) npm run --silent wasm; }
  if [ -x /usr/bin/rustc ]; then later check "WebAssembly" module; else missing "rustc-web and wasi-libc of Debian"; fi
}

# Programs of examples/fe, from a model to what a solver says of it.
solvers() {
  local python=$1
  export PATH=$folder:$PATH
  run_example() { "$python" -B "examples/fe/$1.py" "$scratch/$1" && ls -l "$scratch/$1/$2.png"; }
  # The powers of the number of elements that theory has: -2/9 for equal ones, -1/3 for adapted ones.
  adaptive() { run_example adaptive convergence | tee "$scratch/rates" && awk '/error as/ { rate[$1] = $7 + 0 } END { exit !(rate["equal:"] > -0.27 && rate["adapted:"] < -0.3) }' "$scratch/rates"; }
  # Of a smooth solution it is -4/3; few of the coarse meshes' elements are in the core.
  materials() { "$python" -B examples/fe/materials.py "$scratch/materials" | tee "$scratch/power" && awk '/to the power of/ { power = $NF + 0 } END { exit !(power > -1.5 && power < -1.1) }' "$scratch/power"; }
  # Rayleigh's series is right to 1e-3 for these balls; where the cell begins must not matter.
  unit_cell() { "$python" -B examples/fe/unit_cell.py "$scratch/cell" | tee "$scratch/conducts" && awk '/^off by/ { off = $3 + 0; differ = $NF + 0 } END { exit !(off > 0 && off < 2e-3 && differ < 1e-4) }' "$scratch/conducts"; }
  # The notebook scan_to_stress.ipynb does the same, and is among the tests of Python.
  if [ "$extent" = whole ]; then later check "example: scan to stress with scikit-fem" run_example scikit_fem stress; fi
  later check "example: two materials" materials
  later check "example: a unit cell of two materials" unit_cell
  later check "example: meshes that follow an error estimate" adaptive
  if command -v ccx >/dev/null; then
    later check "example: scan to stress with CalculiX" run_example calculix stress
    later check "example: the step of a deck, in CalculiX" run_example step stress
    # What "meshes that follow an error estimate" has, by another solver.
    if [ "$extent" = whole ]; then later check "example: a notch, with CalculiX" run_example notch convergence; fi
  else
    missing ccx
  fi
}

# Steps in the background, from here on, those that wait longest first.
if command -v python3 >/dev/null; then
  python_package
  if [ -d "$checks" ]; then acceptance; else missing "$checks, the acceptance checks that live beside this repository,"; fi
  cad_programs
else
  missing python3
fi
later tests "tests of tools" cargo test --release "${tools[@]}" --locked --no-fail-fast
# Tokens and branches of the functions; tests/long_functions.txt names the tables that may be long.
later check "functions and comments that fit" "$folder/isoform-measure"
# Pages of docs/ as a site: its links lead somewhere, and each page is found.
later check "site of the documentation" "$folder/isoform-docs" build target/site
# Two pages of pictures hold two thirds of the commands, and are drawn with --full.
pages_run=()
if [ "$extent" = part ]; then
  for page in README.md docs/*.md; do
    case $page in docs/figures.md | docs/gallery.md) ;; *) pages_run+=("$page") ;; esac
  done
fi
later check "commands of the documentation" "$folder/isoform-docs" run "$binary" "${pages_run[@]}"
run_recover() { cd "$scratch" && "$binary" recover -q && ls -l isoform-recover/cup; }
later check "recover on the built-in scan" run_recover
# Whole programs for users of the library.
for example in scan_to_mesh:msh implicit_to_step:step map_to_mesh:ply; do
  later check "example: ${example%:*}" "$folder/examples/${example%:*}" "$scratch/${example/:/.}"
done
settle
finish
