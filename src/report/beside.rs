//! The pages that may lie in one folder, and how they name each other.

use maud::{Markup, html};
use std::path::Path;

/// A page of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// What it is written from; where that is, the page is, too.
    pub records: &'static str,
    /// The page.
    pub file: &'static str,
    /// What other pages call it.
    pub name: &'static str,
}

/// `hedgerow bench`; its records are on the disk before its page is.
pub const INDEX: Page = Page { records: "index.html", file: "index.html", name: "Build speed and tree quality" };
/// `hedgerow accel`.
pub const ACCEL: Page = Page { records: "accel.jsonl", file: "accel.html", name: "Batches, top levels, updates" };
/// `hedgerow stability growth`.
pub const GROWTH: Page = Page { records: "growth.jsonl", file: "growth.html", name: "Growing bounds" };
/// `hedgerow stability large`.
pub const LARGE: Page = Page { records: "large.jsonl", file: "large.html", name: "Large triangles" };
/// `hedgerow stability degenerate`.
pub const DEGENERATE: Page = Page { records: "degenerate.jsonl", file: "degenerate.html", name: "Degenerate scenes" };

/// All of them.
pub const ALL: [Page; 5] = [INDEX, ACCEL, GROWTH, LARGE, DEGENERATE];

impl Page {
    /// Whether it lies, or is about to, in `folder`.
    pub fn is_in(&self, folder: &Path) -> bool {
        folder.join(self.records).is_file()
    }
}

/// Links to the others in `folder`, for the navigation of `own`.
pub fn links(folder: &Path, own: Page) -> Markup {
    html! {
        @for page in ALL.into_iter().filter(|page| *page != own && page.is_in(folder)) {
            a.page href=(page.file) { (page.name) }
        }
    }
}
