# How test.sh counts: sourced by it and by self_test.sh, which tries the cases that must not pass.
# Needs bash and awk. `expected_failures` names the list of failures that are expected.

passed=0
failed=0
ignored=0
failures=()
# What was expected to fail and did, what was not tried, and what missed times in a first run: said
# at the end, each with its reason.
known=()
skipped=()
again=()
harness=$(dirname "${BASH_SOURCE[0]}")

say() { printf '\n== %s\n' "$*"; }
ok() { passed=$((passed + 1)); }
bad() { failed=$((failed + 1)); failures+=("$1"); printf 'FAIL  %s\n' "$1"; }
# missing WHAT: a failure with CI=true, else a line.
missing() {
  if [ "${CI:-}" = true ]; then
    bad "$1 is missing"
  else
    skipped+=("$1 is missing")
    printf 'skip  %s is missing\n' "$1"
  fi
}
# check NAME COMMAND...: one check, its time and its outcome.
check() {
  local name=$1 start=$SECONDS
  shift
  say "$name"
  if "$@"; then ok; printf 'ok    %s (%d s)\n' "$name" $((SECONDS - start)); else bad "$name"; fi
}
# tests NAME COMMAND...: a run of cargo test, whose tests are counted one by one.
tests() {
  local name=$1 log start=$SECONDS status p f i line
  shift
  say "$name"
  log=$(mktemp)
  "$@" 2>&1 | tee "$log" | grep -vE '^test .* \.\.\. ok$|^running|^$|^ +(Doc-tests|Running)'
  status=${PIPESTATUS[0]}
  read -r p f i < <(awk '/^test result:/ { p += $4; f += $6; i += $8 } END { print p + 0, f + 0, i + 0 }' "$log")
  # The lines of isoform_testdata::shared_data.
  while read -r line; do skipped+=("${line#skipped  }"); done < <(grep '^skipped  ' "$log")
  rm -f "$log"
  # A crash or an error of the compiler leaves no failed test behind; a run without tests checks nothing.
  if [ "$f" -eq 0 ] && { [ "$status" -ne 0 ] || [ "$p" -eq 0 ]; }; then f=1; fi
  passed=$((passed + p))
  failed=$((failed + f))
  ignored=$((ignored + i))
  if [ "$f" -gt 0 ]; then failures+=("$name: $f tests"); fi
  printf '%s: %d passed, %d failed (%d s)\n' "$name" "$p" "$f" $((SECONDS - start))
}
# accept NAME SUITE part|whole COMMAND...: an acceptance script, whose checks are counted one by one.
# Its last line must be its own summary, `SUITE: N of M hold`, and its exit status must agree with
# that. Of a whole run all the suite's expected failures must be among the checks. Where times are
# missed, and nothing else, the script runs once more and that run counts, if it checks no less:
# others may have used the machine.
accept() {
  local name=$1 verdict p f t all line
  say "$name"
  verdict=$(mktemp)
  judge "$verdict" "${@:2}"
  read -r p f t < <(counts "$verdict")
  if [ "$f" -gt 0 ] && [ "$t" -eq "$f" ]; then
    again+=("$name: $t times missed in the first run")
    all=$((p + f))
    judge "$verdict" "${@:2}"
    read -r p f t < <(counts "$verdict")
    if [ $((p + f)) -lt "$all" ]; then
      printf 'FAIL  %s: %d checks, %d in the first run\n' "$name" $((p + f)) "$all"
      f=$((f + 1))
    fi
  fi
  while read -r line; do
    case $line in
      "counts "*) ;;
      "known "*) known+=("$2: ${line#known }"); printf '%s\n' "$line" ;;
      *) printf '%s\n' "$line" ;;
    esac
  done <"$verdict"
  rm -f "$verdict"
  passed=$((passed + p))
  failed=$((failed + f))
  if [ "$f" -gt 0 ]; then failures+=("$name: $f checks"); fi
}
# counts VERDICT: checks passed, failed, and those of the failed that are times. Without its last
# line the judge itself has failed.
counts() {
  awk '$1 == "counts" { p = $2; f = $3; t = $4; is_there = 1 }
    END { print p + 0, is_there ? f : 1, t + 0 }' "$1"
}
# judge VERDICT SUITE part|whole COMMAND...: runs an acceptance script, and writes what judge.awk
# says of it.
judge() {
  local verdict=$1 suite=$2 extent=$3 log status
  shift 3
  log=$(mktemp)
  "$@" | tee "$log" | grep -v '^ok '
  status=${PIPESTATUS[0]}
  awk -v suite="$suite" -v extent="$extent" -v status="$status" -f "$harness/judge.awk" \
    "$expected_failures" "$log" >"$verdict"
  rm -f "$log"
}
# finish: the summary, and the exit status.
finish() {
  say "summary"
  if [ "${#skipped[@]}" -gt 0 ]; then printf 'skip  %s\n' "${skipped[@]}"; fi
  if [ "${#again[@]}" -gt 0 ]; then printf 'again %s\n' "${again[@]}"; fi
  if [ "${#known[@]}" -gt 0 ]; then printf 'known %s\n' "${known[@]}"; fi
  if [ "${#failures[@]}" -gt 0 ]; then printf 'FAIL  %s\n' "${failures[@]}"; fi
  printf '%d passed, %d failed, %d expected to fail, %d skipped, %d ignored\n' \
    "$passed" "$failed" "${#known[@]}" "${#skipped[@]}" "$ignored"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}
