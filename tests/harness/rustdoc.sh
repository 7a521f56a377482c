#!/usr/bin/env bash
# Runs rustdoc, as a value of RUSTDOC. When cargo tests the examples of a crate, its documentation is
# written as well, with warnings as errors: all that it needs is compiled by then.
write=()
if [[ " $* " == *" --test "* ]]; then
  skip=
  for argument; do
    case $skip$argument in
      --test) ;;
      --test-run-directory | --test-args) skip=value ;;
      value*) skip= ;;
      *) write+=("$argument") ;;
    esac
  done
  rustdoc "${write[@]}" -D warnings --out-dir "${CARGO_TARGET_DIR:-target}/doc" &
fi
rustdoc "$@" || exit
[ ${#write[@]} -eq 0 ] || wait $!
