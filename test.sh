#!/usr/bin/env bash
# Runs every check of this repository and says how many hold. Needs cargo and, for the acceptance
# checks, python3 with venv.
#
#   ./test.sh          of the acceptance checks a part; about an hour on two cores
#   ./test.sh --full   all of them; hours
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
# Checks that fail and are known to, each with its reason. One that passes is a failure, so that the list shrinks.
expected_failures=tests/expected_failures.txt

# debian COMMAND PACKAGE...: installs packages where the command is missing and we may.
debian() {
  local command=$1
  shift
  if [ -n "$command" ] && command -v "$command" >/dev/null; then return; fi
  if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends "$@"; } >/dev/null 2>&1
  fi
}

# One build of everything gains nothing from incremental files, which fill half of target/.
if [ "${CI:-}" = true ]; then export CARGO_INCREMENTAL=0; fi

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

if cargo fmt --version >/dev/null 2>&1; then
  # fuzz and benches/peers are workspaces of their own.
  for workspace in . fuzz benches/peers; do
    check "format: $workspace" cargo fmt --all --check --manifest-path "$workspace/Cargo.toml"
  done
else
  missing rustfmt
fi
if cargo clippy --version >/dev/null 2>&1; then
  check "lints" cargo clippy --workspace --all-targets --locked --quiet -- -D warnings
else
  missing clippy
fi
# Property tests draw one set of cases, so that a change is judged by itself; --full draws new ones.
if [ "$extent" = part ]; then export PROPTEST_RNG_SEED="${PROPTEST_RNG_SEED:-20261125}"; fi
# Unit and property tests, the command line, who may use whom, the fuzzing corpus replayed, and the
# examples in the documentation. As released, so that all is compiled once; the tools of this
# repository apart, since they ask for other features of foreign crates.
products=(--workspace --exclude isoform-docs --exclude isoform-measure)
tests "tests" cargo test --release "${products[@]}" --locked --no-fail-fast
tests "tests of tools" cargo test -p isoform-docs -p isoform-measure --locked --no-fail-fast
if [ "$extent" = whole ]; then
  tests "tests with assertions" cargo test "${products[@]}" --locked --no-fail-fast
  # Tests that take minutes each.
  tests "random maps" cargo test --release --locked -p isoform --test it random_maps:: -- --ignored
fi
# Tokens and branches of the functions; tests/long_functions.txt names the tables that may be long.
check "functions that fit" cargo run --quiet --locked -p isoform-measure
check "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet
# Of the packages that were tested: of others, features of foreign crates differ, and all would be
# compiled again; pip, too, takes these crates below.
check "release" cargo build --release "${products[@]}" --locked --quiet --lib --bins --examples
# Pages of docs/ as a site: its links lead somewhere, and each page is found.
check "site of the documentation" cargo run --quiet --locked -p isoform-docs -- build target/site
# The viewer that pages embed is what its sources build.
if command -v npm >/dev/null; then
  viewer() { (cd web && npm ci --silent --no-audit --no-fund && npm run --silent check && npm test --silent && npm run --silent build -- --check); }
  check "viewer" viewer
else
  missing npm
fi

binary=${CARGO_TARGET_DIR:-target}/release/isoform
if [ -x "$binary" ]; then
  binary=$(realpath "$binary")
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  # Whole programs for users of the library.
  for example in scan_to_mesh:msh implicit_to_step:step map_to_mesh:ply; do
    check "example: ${example%:*}" "${binary%/*}/examples/${example%:*}" "$scratch/${example/:/.}"
  done
  check "commands of the documentation" cargo run --quiet --locked -p isoform-docs -- run "$binary"
  run_recover() { (cd "$scratch" && "$binary" recover -q && ls -l isoform-recover); }
  check "recover on the built-in scan" run_recover
fi

checks=${ISOFORM_SHARED:-../shared}/checks
# script SCRIPT NAME ARGUMENT...: an acceptance script on the program, whole or the part that --quick takes.
script() {
  local suite=$1 name=$2 quick=()
  shift 2
  if [ "$extent" = part ]; then quick=(--quick); fi
  accept "$name, $extent" "$suite" "$extent" "$venv/bin/python" "$checks/$suite.py" "${quick[@]}" "$@" --isoform "$binary"
}
acceptance() {
  script accept_hyperfun "HyperFun"
  script accept_fit "fits" --project .
  script accept_trust "trust in fits"
  script accept_mesh "meshes"
  # The limit per surface is wide, since dense3 takes a minute or two, joined.
  script accept_rational "rational surfaces" --timeout 900
  script accept_patch "rational patches"
  # Without the sections that need other programs (--peers), or many minutes.
  script accept_implicitize "functions through points" --section order --section paper --section global --section rough
  # The limit per part is wide, since the machine may be busy.
  script accept_recognize "recognition and templates" --seconds 5
  script accept_brep "solids for CAD"
  pages
  accept "meshes in solvers" accept_mesh part "$venv/bin/python" "$checks/accept_mesh.py" --solve --isoform "$binary"
  run_example() { PATH=$(dirname "$binary"):$PATH "$venv/bin/python" -B "examples/fe/$1.py" "$scratch/$1" && ls -l "$scratch/$1/$2.png"; }
  # The powers of the number of elements that theory has: -2/9 for equal ones, -1/3 for adapted ones.
  adaptive() { run_example adaptive convergence | tee "$scratch/rates" && awk '/error as/ { rate[$1] = $7 + 0 } END { exit !(rate["equal:"] > -0.27 && rate["adapted:"] < -0.3) }' "$scratch/rates"; }
  # Of a smooth solution it is -4/3; few of the coarse meshes' elements are in the core.
  materials() { PATH=$(dirname "$binary"):$PATH "$venv/bin/python" -B examples/fe/materials.py "$scratch/materials" | tee "$scratch/power" && awk '/to the power of/ { power = $NF + 0 } END { exit !(power > -1.5 && power < -1.1) }' "$scratch/power"; }
  check "example: scan to stress with scikit-fem" run_example scikit_fem stress
  check "example: two materials" materials
  # Rayleigh's series is right to 1e-3 for these balls; where the cell begins must not matter.
  unit_cell() { PATH=$(dirname "$binary"):$PATH "$venv/bin/python" -B examples/fe/unit_cell.py "$scratch/cell" | tee "$scratch/conducts" && awk '/^off by/ { off = $3 + 0; differ = $NF + 0 } END { exit !(off > 0 && off < 2e-3 && differ < 1e-4) }' "$scratch/conducts"; }
  check "example: a unit cell of two materials" unit_cell
  check "example: meshes that follow an error estimate" adaptive
  if command -v ccx >/dev/null; then
    check "example: scan to stress with CalculiX" run_example calculix stress
    check "example: a notch, with CalculiX" run_example notch convergence
  else
    missing ccx
  fi
}

# Pages in a real browser and pictures without one, with python packages of their own.
pages() {
  local hash
  hash=$(sha256sum "$checks/requirements-view.txt" | cut -c1-16)
  local venv=${XDG_CACHE_HOME:-$HOME/.cache}/isoform/venv-view-$hash
  local modules='import playwright, axe_playwright_python, meshio, numpy, PIL'
  if ! "$venv/bin/python" -c "$modules" 2>/dev/null; then
    python3 -m venv "$venv" && "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$checks/requirements-view.txt"
  fi
  debian chromium chromium
  if ! "$venv/bin/python" -c "$modules" 2>/dev/null; then
    missing "a python environment with playwright"
  elif ! command -v chromium >/dev/null; then
    missing chromium
  else
    browser() { (cd web && ISOFORM=$binary CHROMIUM=$(command -v chromium) npm run --silent browser); }
    if [ -d web/node_modules ]; then check "pages in a browser" browser; else missing npm; fi
    script accept_view "pages" --only pages,picks,acts,domain,report,input,access,hostile,size,serve,render --examples examples
  fi
}

# The Python package: a wheel as pip makes it, its tests, and the acceptance script on it. Ray is
# large, and is tried with --full alone.
python_package() {
  local hash packages=(numpy meshio mypy numpydoc psutil pyarrow pyvista trimesh dask distributed nbclient ipykernel matplotlib pandas scikit-fem)
  local modules='import numpy, meshio, mypy, numpydoc, psutil, pyarrow, pyvista, trimesh, dask, distributed, nbclient, ipykernel, matplotlib, pandas, skfem'
  if [ "$extent" = whole ]; then
    packages+=(ray)
    modules+=', ray'
  fi
  hash=$(printf '%s ' "${packages[@]}" | sha256sum | cut -c1-16)
  local venv=${XDG_CACHE_HOME:-$HOME/.cache}/isoform/venv-python-$hash
  if ! "$venv/bin/python" -c "$modules" 2>/dev/null; then
    mkdir -p "$(dirname "$venv")"
    python3 -m venv "$venv" && "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "${packages[@]}"
  fi
  if ! "$venv/bin/python" -c "$modules" 2>/dev/null; then
    missing "a python environment with ${packages[*]}"
    return
  fi
  wheel() {
    "$venv/bin/python" -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$scratch/wheel" . &&
      "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall "$scratch"/wheel/*.whl
  }
  check "python: wheel" wheel
  unit_tests() { "$venv/bin/python" -B -m unittest discover --quiet --start-directory crates/isoform-py/tests; }
  check "python: tests" unit_tests
  check "python: types" "$venv/bin/python" -m mypy --strict --cache-dir "$scratch/mypy" crates/isoform-py/python/isoform
  if [ -d "$checks" ]; then
    local groups=install,model,points,fit,mesh,tess,patches,more,errors,threads,typing,cost
    if [ "$extent" = whole ]; then groups+=,fleet,large,blocks; fi
    script accept_python "Python" --only "$groups"
  fi
}
if command -v python3 >/dev/null && [ -x "$binary" ]; then python_package; fi

if [ ! -d "$checks" ]; then
  say "acceptance"
  missing "$checks, the acceptance checks that live beside this repository,"
elif ! command -v python3 >/dev/null; then
  missing python3
elif [ ! -x "$binary" ]; then
  bad "acceptance: there is no program to check"
else
  say "acceptance: python packages"
  packages=(numpy scipy nlopt meshio libigl tetgen gmsh scikit-fem scikit-image matplotlib sympy cadquery-ocp)
  modules='import numpy, scipy, nlopt, meshio, igl, tetgen, gmsh, skfem, skimage, matplotlib, sympy, OCP.STEPControl'
  # Outside the clone, and anew whenever the list of requirements changes.
  hash=$(sha256sum "$checks/requirements.txt" | cut -c1-16)
  venv=${XDG_CACHE_HOME:-$HOME/.cache}/isoform/venv-$hash
  if ! "$venv/bin/python" -c "$modules" 2>/dev/null; then
    mkdir -p "$(dirname "$venv")"
    python3 -m venv "$venv" && "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "${packages[@]}"
  fi
  # gmsh's wheel needs libraries of a desktop; ccx is the solver that meshes are given to.
  debian ccx calculix-ccx
  "$venv/bin/python" -c 'import gmsh' 2>/dev/null || debian "" libglu1-mesa libxcursor1 libxft2 libxinerama1
  if "$venv/bin/python" -c "$modules" 2>/dev/null; then acceptance; else missing "a python environment with ${packages[*]}"; fi
fi
finish
