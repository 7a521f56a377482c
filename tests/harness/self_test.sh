#!/usr/bin/env bash
# Tries the harness itself: what must count as a failure is seen to count as one.
set -u
cd "$(dirname "$0")/../.." || exit 2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
list=$folder/expected_failures.txt
cat >"$list" <<'LIST'
# suite | case | reason
accept_x | tree 1 surface | no mesher can
accept_z (whole) | seeds | fails with all seeds
accept_y | other | of another script
LIST
wrong=0
count=0

# counted WHAT "PASSED FAILED KNOWN SKIPPED SLOW" COMMAND...: what the harness counts after a command,
# and that it exits with 0 exactly if something passed and nothing failed.
counted() {
  local what=$1 expected=$2 output got want_status=1 status
  shift 2
  count=$((count + 1))
  output=$(
    # shellcheck source=tests/harness/lib.sh
    . tests/harness/lib.sh
    expected_failures=$list
    unset CI
    [ "$1" = in_ci ] && { shift; export CI=true; }
    "$@"
    finish
  )
  status=$?
  got=$(awk '/ expected to fail, / { known = $1; slow = $7 }
    / passed, .* failed, / { print $1, $3, known, $5, slow }' <<<"$output")
  case $expected in
    "0 "*) ;;
    *" 0 "?" "?" "?) want_status=0 ;;
  esac
  if [ "$got" != "$expected" ] || [ "$status" -ne "$want_status" ]; then
    wrong=$((wrong + 1))
    printf '%s: %s (exit %s), not %s (exit %s):\n%s\n' "$what" "$got" "$status" "$expected" "$want_status" "$output"
  fi
}
# prints STATUS LINE...: a command that prints lines and ends with a status.
prints() { local status=$1; shift; printf '%s\n' "$@"; return "$status"; }
x() { accept "script" accept_x part prints "$@"; }
whole_x() { accept "script" accept_x whole prints "$@"; }
trace=$'Traceback (most recent call last):\n  File "accept_x.py", line 1, in <module>\nKeyError: 1'
listed='FAIL  tree 1 surface  refused  (a mesh)'

counted "all hold" "2 0 0 0 0" x 0 "ok    a  1  (1)" "      a note" "ok    b  2" "accept_x: 2 of 2 hold"
counted "a failure" "1 1 0 0 0" x 1 "ok    a  1" "FAIL  b  2" "accept_x: 1 of 2 hold"
counted "an expected failure" "1 0 1 0 0" x 1 "ok    a  1" "$listed" "accept_x: 1 of 2 hold"
counted "an expected failure beside another" "1 1 1 0 0" x 1 "ok    a  1" "$listed" "FAIL  b  2" "accept_x: 1 of 3 hold"
counted "a crash after an expected failure" "1 1 1 0 0" x 1 "ok    a  1" "$listed" "$trace"
counted "a crash that exits with 0" "1 1 0 0 0" x 0 "ok    a  1" "$trace"
counted "a script that ends early" "1 1 0 0 0" x 0 "ok    a  1"
counted "a crash after the summary" "1 1 0 0 0" x 139 "ok    a  1" "accept_x: 1 of 1 hold"
counted "a crash after the summary with an expected failure" "1 1 1 0 0" x 139 "ok    a  1" "$listed" "accept_x: 1 of 2 hold"
counted "words after the summary" "1 1 0 0 0" x 0 "ok    a  1" "accept_x: 1 of 1 hold" "terminated"
counted "the summary of another script" "1 1 0 0 0" x 0 "ok    a  1" "accept_y: 1 of 1 hold"
counted "no output" "0 1 0 0 0" x 0
counted "nothing checked" "0 1 0 0 0" x 0 "accept_x: 0 of 0 hold"
counted "a summary that hides a failure" "2 2 0 0 0" x 0 "ok    a  1" "FAIL  b  2" "accept_x: 2 of 2 hold"
counted "a summary without its lines" "1 1 0 0 0" x 1 "ok    a  1" "accept_x: 1 of 2 hold"
counted "a listed check that passes" "2 1 0 0 0" x 0 "ok    a  1" "ok    tree 1 surface  meshed" "accept_x: 2 of 2 hold"
counted "a listed check with a longer name" "1 1 0 0 0" x 1 "ok    a  1" "FAIL  tree 1 surface parts  2" "accept_x: 1 of 2 hold"
counted "a check listed for another script" "1 1 0 0 0" x 1 "ok    a  1" "FAIL  other  2" "accept_x: 1 of 2 hold"
counted "a part without the listed check" "1 0 0 0 0" x 0 "ok    a  1" "accept_x: 1 of 1 hold"
counted "a whole run without the listed check" "1 1 0 0 0" whole_x 0 "ok    a  1" "accept_x: 1 of 1 hold"
counted "a whole run with it" "1 0 1 0 0" whole_x 1 "ok    a  1" "$listed" "accept_x: 1 of 2 hold"

z() { accept "script" accept_z "$@"; }
seeds='FAIL  seeds  2 of 3'
counted "a check listed for the whole that a part passes" "1 0 0 0 0" z part prints 0 "ok    seeds  1" "accept_z: 1 of 1 hold"
counted "a check listed for the whole that a part fails" "1 1 0 0 0" z part prints 1 "ok    a  1" "$seeds" "accept_z: 1 of 2 hold"
counted "a check listed for the whole that the whole fails" "1 0 1 0 0" z whole prints 1 "ok    a  1" "$seeds" "accept_z: 1 of 2 hold"
counted "a check listed for the whole that the whole passes" "1 1 0 0 0" z whole prints 0 "ok    seeds  1" "accept_z: 1 of 1 hold"

late='FAIL  fan/time  9'
counted "a limit of seconds missed" "1 0 0 0 1" x 1 "$late" "ok    b  1" "accept_x: 1 of 2 hold"
counted "seconds and another check missed" "0 1 0 0 1" x 1 "$late" "FAIL  b  2" "accept_x: 0 of 2 hold"
counted "seconds missed and no summary" "1 1 0 0 1" x 1 "$late" "ok    b  1"
counted "seconds missed beside an expected failure" "1 0 1 0 1" \
  x 1 "$late" "ok    b  1" "$listed" "accept_x: 1 of 3 hold"
counted "seconds alone" "0 0 0 0 1" x 1 "$late" "accept_x: 0 of 1 hold"
counted "a name that only holds the word" "1 1 0 0 0" \
  x 1 "FAIL  fit/time limit  9" "ok    b  1" "accept_x: 1 of 2 hold"

# Steps in the background count as others do, whichever ends first, and are told in their order.
beside() {
  later check "first" sleep 0.2
  later accept "script" accept_x part prints 1 "$late" "ok    b  1" "accept_x: 1 of 2 hold"
  later check "third" false
  later check "fourth" true
  settle
}
counted "steps side by side" "3 1 0 0 1" beside
nothing_later() { later check "killed" sh -c 'kill -9 $$'; settle; }
counted "a step side by side that crashes" "0 1 0 0 0" nothing_later
told=$(
  # shellcheck source=tests/harness/lib.sh
  . tests/harness/lib.sh
  expected_failures=$list
  beside
  finish
)
count=$((count + 1))
order=$(awk '/^== / { print $2 } /^ +[0-9.]+ +[0-9.]+  / { print $3 }' <<<"$told" | tr '\n' ' ')
if [ "$order" != "first script third fourth steps first script third fourth all summary " ]; then
  wrong=$((wrong + 1))
  printf 'the order of steps and their table:\n%s\n' "$told"
fi

ends_early() { set -e; check "false" false; check "true" true; }
counted "a failure in a shell that ends at failures" "1 1 0 0 0" ends_early

result() { printf 'test result: %s. %s passed; %s failed; 1 ignored; 0 measured; 0 filtered out' "$@"; }
good=$(result ok 3 0)
skip=$'\nskipped  scans: ../shared/data is not there\n'
counted "tests" "6 0 0 0 0" tests "tests" prints 0 "test a ... ok" "$good" "$good"
counted "tests of which one skips" "3 0 0 1 0" tests "tests" prints 0 "$skip" "$good"
counted "tests of which two skip" "3 0 0 2 0" tests "tests" prints 0 "test a ... $skip" "ok$skip" "$good"
counted "a failed test" "2 1 0 0 0" tests "tests" prints 101 "$(result FAILED 2 1)"
counted "a test that crashes" "3 1 0 0 0" tests "tests" prints 101 "$good" "signal: 11, SIGSEGV: invalid memory reference"
counted "no tests" "0 1 0 0 0" tests "tests" prints 0 "$(result ok 0 0)"

counted "something missing" "0 0 0 1 0" missing "gmsh"
counted "something missing in CI" "0 1 0 0 0" in_ci missing "gmsh"
counted "a check" "1 0 0 0 0" check "a check" true
counted "a check that fails" "0 1 0 0 0" check "a check" false

# Data beside the repository has one way in, which counts what is skipped.
if grep -rnE 'ISOFORM_SHARED|\.\./shared' crates --include='*.rs' | grep -v '^crates/isoform-testdata/'; then
  printf 'these look beside the repository without isoform_testdata::shared_data\n'
  wrong=$((wrong + 1))
fi
if grep -rnE 'print(ln)?!\("skip' crates --include='*.rs'; then
  printf 'these skip without being counted\n'
  wrong=$((wrong + 1))
fi
# Every suite of the list is asked for by someone.
while read -r suite; do
  if ! grep -qE "^(part|whole) [|] $suite [|]" tests/acceptance.txt && ! grep -rqF "ExpectedFailures::of(\"$suite\")" crates; then
    printf 'nobody asks for the suite %s of tests/expected_failures.txt\n' "$suite"
    wrong=$((wrong + 1))
  fi
done < <(sed -nE 's/^([^#| ]+)( [(]whole[)])? [|] .*/\1/p' tests/expected_failures.txt | sort -u)
printf '%d cases of the harness, %d wrong\n' "$count" "$wrong"
[ "$wrong" -eq 0 ]
