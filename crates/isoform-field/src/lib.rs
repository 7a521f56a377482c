//! Implicit functions.
