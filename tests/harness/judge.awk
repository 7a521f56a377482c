# Judges the output of an acceptance script: awk -v suite=S -v extent=part|whole -v status=N
# -f judge.awk EXPECTED_FAILURES LOG. Checks are lines `ok|FAIL  name  figure  (target)`. Prints a
# line for each expected failure, for each limit of seconds that was missed (by the check's name; no
# failure) and for each fault, and last `counts PASSED FAILED`.

function fault(text) {
  printf "FAIL  %s\n", text
  faults++
}

# The name of the check that a line is about: up to the first two spaces.
function name_of(line) {
  sub(/^(ok|FAIL) +/, "", line)
  sub(/  .*/, "", line)
  return line
}

FNR == NR {
  if ($0 ~ /^#/ || $0 ~ /^[ \t]*$/) next
  if (split($0, field, / [|] /) != 3) fault("`" $0 "` is not `suite | case | reason`")
  else if (field[1] == suite || extent == "whole" && field[1] == suite " (whole)") reason[field[2]] = field[3]
  next
}

/[^ \t]/ { last = $0 }
/^FAIL / { fails++; failing[name_of($0)]++; line[name_of($0)] = $0 }
/^ok / { holding[name_of($0)]++ }

END {
  of_time = "(^|[ /])(time|seconds|CPU s|speed of values)( to peers, (median|longest))?$"
  for (name in failing) {
    if (name in reason) printf "known %s: %s\n", name, reason[name]
    else if (name ~ of_time) {
      sub(/^FAIL +/, "", line[name])
      printf "slow %s\n", line[name]
    } else unexpected += failing[name]
  }
  for (name in reason) {
    if (name in failing) continue
    if (name in holding) fault(name ": passes, take it off the list of expected failures")
    else if (extent == "whole") fault(name ": is on the list of expected failures and was not tried")
  }
  if (last ~ "^" suite ": [0-9]+ of [0-9]+ hold$") {
    split(last, word, " ")
    held = word[2] + 0
    total = word[4] + 0
    if (total == 0) fault(suite ": nothing was checked")
    else if (total - held != fails) fault(suite ": " fails + 0 " lines FAIL, but `" last "`")
    if (status != (held < total ? 1 : 0)) fault(suite ": exit status " status " after `" last "`")
  } else {
    fault(suite ": ended without its summary, exit status " status)
    for (name in holding) held += holding[name]
  }
  print "counts", held + 0, unexpected + faults
}
