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
accept_y | other | of another script
LIST
wrong=0
count=0

# counted WHAT "PASSED FAILED KNOWN SKIPPED" COMMAND...: what the harness counts after a command, and
# that it exits with 0 exactly if something passed and nothing failed.
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
  got=$(sed -nE 's/^([0-9]+) passed, ([0-9]+) failed, ([0-9]+) expected to fail, ([0-9]+) skipped, .*/\1 \2 \3 \4/p' <<<"$output")
  case $expected in
    "0 "*) ;;
    *" 0 "?" "?) want_status=0 ;;
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

counted "all hold" "2 0 0 0" x 0 "ok    a  1  (1)" "      a note" "ok    b  2" "accept_x: 2 of 2 hold"
counted "a failure" "1 1 0 0" x 1 "ok    a  1" "FAIL  b  2" "accept_x: 1 of 2 hold"
counted "an expected failure" "1 0 1 0" x 1 "ok    a  1" "$listed" "accept_x: 1 of 2 hold"
counted "an expected failure beside another" "1 1 1 0" x 1 "ok    a  1" "$listed" "FAIL  b  2" "accept_x: 1 of 3 hold"
counted "a crash after an expected failure" "1 1 1 0" x 1 "ok    a  1" "$listed" "$trace"
counted "a crash that exits with 0" "1 1 0 0" x 0 "ok    a  1" "$trace"
counted "a script that ends early" "1 1 0 0" x 0 "ok    a  1"
counted "a crash after the summary" "1 1 0 0" x 139 "ok    a  1" "accept_x: 1 of 1 hold"
counted "a crash after the summary with an expected failure" "1 1 1 0" x 139 "ok    a  1" "$listed" "accept_x: 1 of 2 hold"
counted "words after the summary" "1 1 0 0" x 0 "ok    a  1" "accept_x: 1 of 1 hold" "terminated"
counted "the summary of another script" "1 1 0 0" x 0 "ok    a  1" "accept_y: 1 of 1 hold"
counted "no output" "0 1 0 0" x 0
counted "nothing checked" "0 1 0 0" x 0 "accept_x: 0 of 0 hold"
counted "a summary that hides a failure" "2 2 0 0" x 0 "ok    a  1" "FAIL  b  2" "accept_x: 2 of 2 hold"
counted "a summary without its lines" "1 1 0 0" x 1 "ok    a  1" "accept_x: 1 of 2 hold"
counted "a listed check that passes" "2 1 0 0" x 0 "ok    a  1" "ok    tree 1 surface  meshed" "accept_x: 2 of 2 hold"
counted "a listed check with a longer name" "1 1 0 0" x 1 "ok    a  1" "FAIL  tree 1 surface parts  2" "accept_x: 1 of 2 hold"
counted "a check listed for another script" "1 1 0 0" x 1 "ok    a  1" "FAIL  other  2" "accept_x: 1 of 2 hold"
counted "a part without the listed check" "1 0 0 0" x 0 "ok    a  1" "accept_x: 1 of 1 hold"
counted "a whole run without the listed check" "1 1 0 0" whole_x 0 "ok    a  1" "accept_x: 1 of 1 hold"
counted "a whole run with it" "1 0 1 0" whole_x 1 "ok    a  1" "$listed" "accept_x: 1 of 2 hold"

# in_turn FILE -- STATUS LINE... -- STATUS LINE...: ends in its first run as the first list says,
# then as the second.
in_turn() {
  local file=$1 first=()
  shift 2
  while [ "$1" != -- ]; do first+=("$1"); shift; done
  shift
  if [ -e "$file" ]; then prints "$@"; else touch "$file"; prints "${first[@]}"; fi
}
twice() { accept "script" accept_x part in_turn "$folder/$count" -- "$@"; }
slow='FAIL  fan/time  9'
slow_run=(1 "$slow" "ok    b  1" "accept_x: 1 of 2 hold")
good_run=(0 "ok    fan/time  1" "ok    b  1" "accept_x: 2 of 2 hold")
bad_run=(1 "ok    fan/time  1" "FAIL  b  2" "accept_x: 1 of 2 hold")
counted "a time missed once" "2 0 0 0" twice "${slow_run[@]}" -- "${good_run[@]}"
counted "a time missed twice" "1 1 0 0" twice "${slow_run[@]}" -- "${slow_run[@]}"
counted "another check missed then" "1 1 0 0" twice "${slow_run[@]}" -- "${bad_run[@]}"
counted "no end then" "1 1 0 0" twice "${slow_run[@]}" -- 1 "ok    b  1"
counted "fewer checks then" "1 1 0 0" \
  twice "${slow_run[@]}" -- 0 "ok    b  1" "accept_x: 1 of 1 hold"
counted "another check missed first" "1 1 0 0" twice "${bad_run[@]}" -- "${good_run[@]}"
counted "a time and another check missed" "0 2 0 0" \
  twice 1 "$slow" "FAIL  b  2" "accept_x: 0 of 2 hold" -- "${good_run[@]}"
counted "a time missed and no summary" "1 2 0 0" twice 1 "$slow" "ok    b  1" -- "${good_run[@]}"
counted "a time missed beside an expected failure" "2 0 1 0" \
  twice 1 "$slow" "ok    b  1" "$listed" "accept_x: 1 of 3 hold" \
  -- 1 "ok    fan/time  1" "ok    b  1" "$listed" "accept_x: 2 of 3 hold"
counted "a name that only holds the word" "1 1 0 0" \
  twice 1 "FAIL  fit/time limit  9" "ok    b  1" "accept_x: 1 of 2 hold" -- "${good_run[@]}"

result() { printf 'test result: %s. %s passed; %s failed; 1 ignored; 0 measured; 0 filtered out' "$@"; }
good=$(result ok 3 0)
skip=$'\nskipped  scans: ../shared/data is not there\n'
counted "tests" "6 0 0 0" tests "tests" prints 0 "test a ... ok" "$good" "$good"
counted "tests of which one skips" "3 0 0 1" tests "tests" prints 0 "$skip" "$good"
counted "tests of which two skip" "3 0 0 2" tests "tests" prints 0 "test a ... $skip" "ok$skip" "$good"
counted "a failed test" "2 1 0 0" tests "tests" prints 101 "$(result FAILED 2 1)"
counted "a test that crashes" "3 1 0 0" tests "tests" prints 101 "$good" "signal: 11, SIGSEGV: invalid memory reference"
counted "no tests" "0 1 0 0" tests "tests" prints 0 "$(result ok 0 0)"

counted "something missing" "0 0 0 1" missing "gmsh"
counted "something missing in CI" "0 1 0 0" in_ci missing "gmsh"
counted "a check" "1 0 0 0" check "a check" true
counted "a check that fails" "0 1 0 0" check "a check" false

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
  if ! grep -qE "(script|accept .*) $suite " test.sh && ! grep -rqF "ExpectedFailures::of(\"$suite\")" crates; then
    printf 'nobody asks for the suite %s of tests/expected_failures.txt\n' "$suite"
    wrong=$((wrong + 1))
  fi
done < <(sed -nE 's/^([^#| ]+) [|] .*/\1/p' tests/expected_failures.txt | sort -u)
printf '%d cases of the harness, %d wrong\n' "$count" "$wrong"
[ "$wrong" -eq 0 ]
