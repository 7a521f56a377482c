#!/bin/sh
# Runs rustc, as a value of RUSTC_WRAPPER. Unit tests are compiled without optimisation and
# integration tests with little: they are compiled in a third of the time, and libraries and programs
# remain as released. Cargo does not know of it, so that nothing is compiled again without it.
case " $* " in
*" --crate-name it "*) exec "$@" -C opt-level=1 ;;
*" --test "*) exec "$@" -C opt-level=0 -C codegen-units=4 ;;
*) exec "$@" ;;
esac
