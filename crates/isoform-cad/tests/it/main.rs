//! Shapes of STEP files of other programs.

mod common;
mod hostile;
mod referee;
mod seamless;
