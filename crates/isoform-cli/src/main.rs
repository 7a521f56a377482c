//! The command `isoform`: the verbs on a terminal.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    isoform_verbs::program()
}
