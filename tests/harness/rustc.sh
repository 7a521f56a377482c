#!/bin/sh
# Runs rustc, as a value of RUSTC_WRAPPER. Unit tests are compiled without optimisation and
# integration tests with little: they are compiled in a third of the time, and libraries and programs
# remain as released. Where CLIPPY_ARGS is set, tests and examples, which hold all of the code, are
# linted as they are compiled, so that nothing is read a second time for the lints.
lint=${CLIPPY_ARGS:+clippy-driver}
case " $* " in
*" --cap-lints "*) exec "$@" ;;
*" --crate-name it "*) exec $lint "$@" -C opt-level=1 ;;
*" --test "*) exec $lint "$@" -C opt-level=0 -C codegen-units=4 ;;
*"/examples/"*) exec $lint "$@" ;;
*) exec "$@" ;;
esac
