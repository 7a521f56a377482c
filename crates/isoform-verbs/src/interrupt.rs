//! Ctrl-C: once to stop and keep the best, twice to abort.

use std::sync::atomic::{AtomicBool, Ordering};

/// Set by the first Ctrl-C.
static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Exit code of an interrupted run.
pub(crate) const INTERRUPTED: u8 = 130;

/// From now on Ctrl-C sets the flag that is given back; a second one ends the program at once.
pub(crate) fn watch() -> &'static AtomicBool {
    // Fails where a handler exists or signals are not to be had; then Ctrl-C ends the program, as
    // it would anyway. A page ends the worker that runs WebAssembly.
    #[cfg(not(target_family = "wasm"))]
    let _ = ctrlc::set_handler(|| {
        if CANCELLED.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(INTERRUPTED));
        }
    });
    &CANCELLED
}

/// Returns true if Ctrl-C was pressed.
pub(crate) fn happened() -> bool {
    CANCELLED.load(Ordering::SeqCst)
}
