#!/bin/sh
# Runs rustc, as a value of RUSTC_WRAPPER. Tests are compiled without optimisation or with little,
# in a third of the time; libraries and programs remain as released. Where CLIPPY_ARGS is set, tests
# and examples, which hold all of the code, are linted as they are compiled, so that nothing is read
# a second time for the lints.
lint=${CLIPPY_ARGS:+clippy-driver}
case " $* " in
*" --cap-lints "*) exec "$@" ;;
*" --crate-name it "*)
  # Tests of these crates compute much themselves.
  case $CARGO_PKG_NAME in
  isoform | isoform-fit | isoform-io | isoform-mesh | isoform-render) exec $lint "$@" -C opt-level=1 ;;
  *) exec $lint "$@" -C opt-level=0 ;;
  esac
  ;;
*" --test "*) exec $lint "$@" -C opt-level=0 -C codegen-units=4 ;;
*"/examples/"*) exec $lint "$@" ;;
*) exec "$@" ;;
esac
