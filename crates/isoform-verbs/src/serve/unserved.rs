//! The server where there are no sockets: it cannot be opened.

use isoform_view::Page;
use std::io;

/// A page that no browser gets.
pub(super) struct ServedPage;

impl ServedPage {
    /// The first page.
    pub(super) fn new(_: &Page) -> Self {
        Self
    }
}

/// No server.
pub(super) enum Site {}

impl Site {
    /// Fails.
    pub(super) fn open(_: u16, _: ServedPage) -> io::Result<Self> {
        Err(io::ErrorKind::Unsupported.into())
    }

    /// The address of the page.
    pub(super) fn address(&self) -> String {
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
