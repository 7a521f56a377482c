# shellcheck shell=bash
# How test.sh counts: sourced by it and by self_test.sh, which tries the cases that must not pass.
# Needs bash and awk. `expected_failures` names the list of failures that are expected.
#
# A step is a command, and a way to judge its output and exit status:
#   check NAME COMMAND...                           its exit status
#   tests NAME COMMAND...                           the tests of a run of cargo test
#   accept NAME SUITE part|whole COMMAND...         the checks of an acceptance script
#   later check|tests|accept NAME ...               the same in the background, some at a time;
#   settle                                          waits for all of these, and judges them

passed=0
failed=0
ignored=0
failures=()
# What was expected to fail and did, what was not tried, and what missed a limit of seconds: said at
# the end, each with its reason.
known=()
skipped=()
slow=()
# The steps that have ended, as `SECONDS CPU-SECONDS NAME`, and those that run in the background, as
# `describe` has them.
steps=()
running=()
harness=$(dirname "${BASH_SOURCE[0]}")
logs=$(mktemp -d)
# Two more than there are cores: those with a browser wait for most of their time.
slots=$(($(nproc 2>/dev/null || echo 2) + 2))

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

check() { now check "$@"; }
tests() { now tests "$@"; }
accept() { now accept "$@"; }

# describe KIND NAME [SUITE EXTENT] COMMAND...: sets `step` to what is known of a step, LOG KIND NAME
# SUITE EXTENT between tabs, and `command`.
describe() {
  local kind=$1 name=$2 suite=- extent=-
  shift 2
  if [ "$kind" = accept ]; then suite=$1 extent=$2; shift 2; fi
  step=$(mktemp "$logs/XXXXXX")$'\t'$kind$'\t'$name$'\t'$suite$'\t'$extent
  command=("$@")
}
# now KIND NAME [SUITE EXTENT] COMMAND...: a step, run and judged at once.
now() {
  local step command
  describe "$@"
  say "$2"
  measured "${step%%$'\t'*}" "${command[@]}"
  judge "$step"
}
# later KIND NAME [SUITE EXTENT] COMMAND...: a step in the background, once fewer than `slots` run.
later() {
  local step command
  describe "$@"
  while [ "$(jobs -rp | wc -l)" -ge "$slots" ]; do wait -n; done
  printf 'begin %s\n' "$2"
  measured "${step%%$'\t'*}" "${command[@]}" &
  running+=("$step")
}
# settle: waits for the steps in the background, and judges them in their order.
settle() {
  local step name
  wait
  for step in "${running[@]}"; do
    IFS=$'\t' read -r _ _ name _ <<<"$step"
    say "$name"
    judge "$step"
  done
  running=()
}
# apart COMMAND...: a command in a shell of its own, which may change its folder.
apart() ("$@")
# measured LOG COMMAND...: runs a command; LOG holds its output, LOG.status its exit status and
# LOG.time its seconds, of the user and of the system.
measured() {
  local log=$1 status=0 TIMEFORMAT='%R %U %S'
  shift
  # A shell that ends at the first failure (set -e) goes on after this one.
  { time apart "$@" </dev/null >"$log" 2>&1; } 2>"$log.time" || status=$?
  echo "$status" >"$log.status"
}
# judge STEP: counts what a step that has ended says.
judge() {
  local log kind name suite extent status wall cpu failed_before=$failed
  IFS=$'\t' read -r log kind name suite extent <<<"$1"
  status=$(cat "$log.status")
  read -r wall cpu < <(tail -1 "$log.time" | awk '{ printf "%.1f %.1f\n", $1, $2 + $3 }')
  steps+=("$wall $cpu $name")
  case $kind in
    check) if [ "$status" -eq 0 ]; then ok; else bad "$name"; fi ;;
    tests) judge_tests "$name" "$status" "$log" ;;
    accept) judge_accept "$name" "$suite" "$extent" "$status" "$log" ;;
  esac
  if [ "$failed" -eq "$failed_before" ]; then
    printf 'ok    %s (%s s)\n' "$name" "$wall"
  elif [ "$kind" = check ]; then
    tail -n 200 "$log"
  fi
  rm -f "$log" "$log.status" "$log.time"
}
# judge_tests NAME STATUS LOG: the tests of a run of cargo test, one by one.
judge_tests() {
  local name=$1 status=$2 log=$3 p f i line
  grep -vE '^test .* \.\.\. ok$|^running|^$|^ +(Doc-tests|Running)|^test result: ok. 0 passed' "$log"
  read -r p f i < <(awk '/^test result:/ { p += $4; f += $6; i += $8 } END { print p + 0, f + 0, i + 0 }' "$log")
  # The lines of isoform_testdata::shared_data.
  while read -r line; do skipped+=("${line#skipped  }"); done < <(grep '^skipped  ' "$log")
  # A crash or an error of the compiler leaves no failed test behind; a run without tests checks nothing.
  if [ "$f" -eq 0 ] && { [ "$status" -ne 0 ] || [ "$p" -eq 0 ]; }; then f=1; fi
  passed=$((passed + p))
  failed=$((failed + f))
  ignored=$((ignored + i))
  if [ "$f" -gt 0 ]; then failures+=("$name: $f tests"); fi
  printf '%s: %d passed, %d failed\n' "$name" "$p" "$f"
}
# judge_accept NAME SUITE part|whole STATUS LOG: the checks of an acceptance script, one by one. Its
# last line must be its own summary, `SUITE: N of M hold`, and its exit status must agree with that.
# Of a whole run all the suite's expected failures must be among the checks. Limits of seconds that
# are missed are said, and are no failures: others may use the machine.
judge_accept() {
  local name=$1 suite=$2 extent=$3 status=$4 log=$5 p=0 f=1 line
  grep -v '^ok ' "$log"
  while read -r line; do
    case $line in
      "counts "*) read -r p f <<<"${line#counts }" ;;
      "known "*) known+=("$suite: ${line#known }") ;;
      "slow "*) slow+=("$suite: ${line#slow }") ;;
    esac
    printf '%s\n' "$line"
  done < <(awk -v suite="$suite" -v extent="$extent" -v status="$status" -f "$harness/judge.awk" \
    "$expected_failures" "$log")
  passed=$((passed + p))
  failed=$((failed + f))
  if [ "$f" -gt 0 ]; then failures+=("$name: $f checks"); fi
}
# table: what each step took. A step of more than a tenth of the whole is marked.
table() {
  printf '%s\n' "${steps[@]}" | awk -v whole="$SECONDS" '
    NF {
      cpu += $2
      mark = $1 > whole / 10 ? "  <- more than a tenth" : ""
      name = $0; sub(/^[^ ]+ [^ ]+ /, "", name)
      printf "%8.1f %8.1f  %s%s\n", $1, $2, name, mark
    }
    BEGIN { printf "%8s %8s  %s\n", "seconds", "CPU s", "step" }
    END { printf "%8.1f %8.1f  %s\n", whole, cpu, "all" }'
}
# finish: the table of steps, the summary, and the exit status.
finish() {
  say "steps"
  table
  say "summary"
  if [ "${#skipped[@]}" -gt 0 ]; then printf 'skip  %s\n' "${skipped[@]}"; fi
  if [ "${#slow[@]}" -gt 0 ]; then printf 'slow  %s\n' "${slow[@]}"; fi
  if [ "${#known[@]}" -gt 0 ]; then printf 'known %s\n' "${known[@]}"; fi
  if [ "${#failures[@]}" -gt 0 ]; then printf 'FAIL  %s\n' "${failures[@]}"; fi
  printf '%d expected to fail, %d ignored, %d limits of seconds missed\n' \
    "${#known[@]}" "$ignored" "${#slow[@]}"
  printf '%d passed, %d failed, %d skipped\n' "$passed" "$failed" "${#skipped[@]}"
  rm -rf "$logs"
  [ "$failed" -eq 0 ] && [ "$passed" -gt 0 ]
  exit
}
