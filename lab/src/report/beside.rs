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
/// `hedgerow stability growth --level top`.
pub const GROWTH_TOP: Page =
    Page { records: "growth-top.jsonl", file: "growth-top.html", name: "Growing bounds of top levels" };
/// `hedgerow stability large`.
pub const LARGE: Page = Page { records: "large.jsonl", file: "large.html", name: "Large triangles" };
/// `hedgerow stability degenerate`.
pub const DEGENERATE: Page = Page { records: "degenerate.jsonl", file: "degenerate.html", name: "Degenerate scenes" };
/// `hedgerow stability greedy`.
pub const GREEDY: Page = Page { records: "greedy.jsonl", file: "greedy.html", name: "Greedy trees" };
/// `hedgerow animate`.
pub const ANIMATE: Page = Page { records: "animate.jsonl", file: "animate.html", name: "Moving scenes" };

/// `hedgerow fly`.
pub const FLY: Page = Page { records: "fly.jsonl", file: "fly.html", name: "Camera paths" };

/// `hedgerow cpu-builders`.
pub const CPU_BUILDERS: Page =
    Page { records: "cpu-builders.jsonl", file: "cpu-builders.html", name: "Builders on the CPU" };

/// `hedgerow predict`.
pub const PREDICT: Page = Page { records: "predict.jsonl", file: "predict.html", name: "What predicts tracing" };

/// `hedgerow codes`.
pub const CODES: Page = Page { records: "codes.jsonl", file: "codes.html", name: "Codes" };

/// All of them.
pub const ALL: [Page; 12] =
    [INDEX, CPU_BUILDERS, PREDICT, CODES, ACCEL, ANIMATE, FLY, GROWTH, GROWTH_TOP, LARGE, DEGENERATE, GREEDY];

impl Page {
    /// What files of it begin with.
    pub fn stem(&self) -> &'static str {
        self.file.trim_end_matches(".html")
    }

    /// Whether it lies, or is about to, in `folder`.
    pub fn is_in(&self, folder: &Path) -> bool {
        folder.join(self.records).is_file()
    }
}

/// The page of `hedgerow navigate` for a scene of this name as [`super::names::slug`] has it.
pub fn navigator_of(scene: &str) -> String {
    format!("{NAVIGATOR}{scene}.html")
}

const NAVIGATOR: &str = "navigate-";

/// The scenes that have such a page in `folder`.
fn navigated(folder: &Path) -> Vec<String> {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let scene = |file: &str| Some(file.strip_prefix(NAVIGATOR)?.strip_suffix(".html")?.to_owned());
    let mut scenes: Vec<String> = files.filter_map(|entry| scene(entry.file_name().to_str()?)).collect();
    scenes.sort();
    scenes
}

/// Links to the others in `folder`, for the navigation of the page in the file `own`.
pub fn links(folder: &Path, own: &str) -> Markup {
    html! {
        @for page in ALL.into_iter().filter(|page| page.file != own && page.is_in(folder)) {
            a.page href=(page.file) { (page.name) }
        }
        @for scene in navigated(folder).iter().filter(|scene| navigator_of(scene) != own) {
            a.page href=(navigator_of(scene)) { "Trees of " (scene) }
        }
    }
}
