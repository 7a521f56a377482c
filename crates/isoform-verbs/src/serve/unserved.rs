//! Pages on a machine without sockets: they cannot be served.

use isoform_view::Page;
use std::io;

/// No page.
pub(super) enum Pages {}

impl Pages {
    /// Fails.
    pub(super) fn open(_: u16, _: &Page) -> io::Result<Self> {
        Err(io::ErrorKind::Unsupported.into())
    }

    /// The address of the page.
    pub(super) fn address(&self) -> &str {
        match *self {}
    }

    /// Shows another page.
    pub(super) fn show(&self, _: &Page) {
        match *self {}
    }

    /// Keeps the page, and says why.
    pub(super) fn fail(&self, _: &str) {
        match *self {}
    }
}
