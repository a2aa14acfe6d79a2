//! Where a command's words go: records as JSON, progress bars.

use super::Common;
use anyhow::Context;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;

/// `--json FILE`: where the record goes.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Json {
    /// Write the record as JSON to a file; with `-` to stdout and nothing else
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

impl Json {
    /// Whether stdout belongs to the record, so that tables must stay away from it.
    pub fn takes_stdout(&self) -> bool {
        self.json.as_deref().is_some_and(|path| path.as_os_str() == "-")
    }

    /// Writes each record as one line, if `--json` was given.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_each<R: serde::Serialize>(&self, records: impl IntoIterator<Item = R>) -> anyhow::Result<()> {
        let Some(path) = &self.json else { return Ok(()) };
        let mut lines = String::new();
        for record in records {
            lines += &serde_json::to_string(&record).context("the record cannot be written as JSON")?;
            lines.push('\n');
        }
        if self.takes_stdout() {
            std::io::stdout().write_all(lines.as_bytes())?;
        } else {
            std::fs::write(path, lines).map_err(crate::Error::file(path))?;
        }
        Ok(())
    }
}

/// A progress bar on stderr: drawn on a terminal alone, and not with `--quiet`; gone when dropped.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar over `total` things, or a spinner where `total` is 0.
    pub fn new(common: &Common, message: &str, total: u64) -> Bar {
        let template = if total == 0 { "{spinner} {msg} {elapsed}" } else { "{msg} {wide_bar} {pos}/{len} {eta}" };
        Bar::with(common, message, total, template)
    }

    /// A bar over bytes.
    pub fn bytes(common: &Common, message: &str) -> Bar {
        Bar::with(common, message, 1, "{msg} {wide_bar} {bytes}/{total_bytes} {eta}")
    }

    fn with(common: &Common, message: &str, total: u64, template: &str) -> Bar {
        let hidden = common.quiet || !std::io::stderr().is_terminal();
        let target = if hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        bar.set_style(ProgressStyle::with_template(template).expect("the templates above are well-formed"));
        bar.set_message(message.to_owned());
        Bar(bar)
    }

    /// `done` of `total` is done.
    pub fn set(&self, done: u64, total: u64) {
        self.0.set_length(total);
        self.0.set_position(done);
    }

    /// One more is done.
    pub fn step(&self) {
        self.0.inc(1);
    }

    /// Says what is being done.
    pub fn say(&self, message: &str) {
        self.0.set_message(message.to_owned());
        self.0.tick();
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
