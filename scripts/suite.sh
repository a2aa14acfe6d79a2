#!/usr/bin/env bash
# The test suite, as cargo-nextest lists it: scripts/suite.sh PROFILE FEATURES [FILTER]. The Makefile calls it, under a bound.
#
# Without a cache lavapipe compiles for longer than tests run; what it has compiled, later processes find. Tests of one module need
# the same shaders, and side by side would compile them twice. So a core takes a part of the suite at a time, whose tests run one
# after another. What a part has printed is shown when it ends; which parts failed, at the end.
#
# nextest runs a process a test. But each process makes its pipelines anew, compiled before or not: in parts that use most of them this
# took a tenth to a sixth of the time. Of these parts a process runs a module. What hangs or crashes ends its module.
set -euo pipefail
cd "$(dirname "$0")/.."
profile=$1 features=$2 filter=${3:-all()}

# The longest first, but for that with the quick check, which runs every pass (lab): most are compiled by then. A short one last,
# so that no core waits long for the others.
parts=(bvh accel kdtree trace others lab conditional)
filter_of() {
  case $1 in
    lab | conditional) echo "binary_id(hedgerow-lab::$1)" ;;
    others) echo 'not (binary_id(/^hedgerow-lab::/) | binary_id(hedgerow::main) & test(/^(bvh|accel|trace|kdtree)::/))' ;;
    *) echo "binary_id(hedgerow::main) & test(/^$1::/)" ;;
  esac
}

cores=$(nproc 2>/dev/null || getconf _NPROCESSORS_ONLN)
at_once=$((cores < ${#parts[@]} ? cores : ${#parts[@]}))
output=$(mktemp -d)
trap 'rm -rf "$output"' EXIT
# The bound ran out: what ran then has printed nothing yet.
trap 'tail -n 20 "$output"/* >&2; exit 124' TERM

# Seconds for a module: the longest takes 300 on two slow cores, with no shader compiled before.
module_bound=1200
within=()
[ -z "$(command -v timeout)" ] || within=(timeout --kill-after 10 "$module_bound")

# Tests of hedgerow::main, a process a module.
run_modules() {
  local tests bin module names status=0 own
  tests=$(scripts/cargo.sh nextest list --verbose --message-format oneline --cargo-profile "$profile" --features "$features" \
    -E "($(filter_of "$1")) & ($filter)") || return
  tests=$(printf '%s\n' "$tests" | grep '^hedgerow::main ' | grep -v '(skipped)$' || true)
  [ -n "$tests" ] || return 0
  bin=$(printf '%s\n' "$tests" | sed -n '1s/.*\[bin: \([^]]*\)\].*/\1/p')
  tests=$(printf '%s\n' "$tests" | awk '{ print $2 }')
  for module in $(printf '%s\n' "$tests" | sed 's/::[^:]*$//' | sort -u); do
    names=($(printf '%s\n' "$tests" | grep -E "^${module}::[^:]*$"))
    SECONDS=0 own=0
    ${within[@]+"${within[@]}"} "$bin" --exact "${names[@]}" --test-threads 1 || own=$?
    # What hangs or crashes is the last test that is named.
    [ $own = 0 ] || { status=1; printf '\nFAIL %s, exit status %s\n' "$module" $own; }
    printf '%s: %s s\n' "$module" $SECONDS
  done
  return $status
}

run_part() {
  local status=0 levels=(--final-status-level skip)
  # Tests of other parts count as skipped; which cannot run here, and why, is listed with the conditional ones.
  [ "$1" = conditional ] || levels=(--final-status-level slow)
  case $1 in
    bvh | accel | kdtree | trace) run_modules "$1" >"$output/$1" 2>&1 || status=$? ;;
    *) scripts/cargo.sh nextest run --cargo-profile "$profile" --features "$features" --no-tests pass -j $((cores / at_once)) \
      "${levels[@]}" -E "($(filter_of "$1")) & ($filter)" >"$output/$1" 2>&1 || status=$? ;;
  esac
  [ $status = 0 ] || touch "$output/$1.failed"
  printf '== tests: %s\n' "$1"
  cat "$output/$1"
}

for part in "${parts[@]}"; do
  while [ "$(jobs -rp | wc -l)" -ge "$at_once" ]; do sleep 1; done
  run_part "$part" &
done
wait
status=0
for part in "${parts[@]}"; do
  [ -e "$output/$part.failed" ] || continue
  status=1
  printf '== failed: %s\n' "$part"
  grep -E '^ *(FAIL|TIMEOUT|SIG[A-Z]+|ABORT|TERMINATING) |^test .* FAILED$|Summary|^error' "$output/$part" | sort -u || true
done >&2
exit $status
