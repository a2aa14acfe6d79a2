//! `hedgerow report`: one page of the records of many folders.

use super::{joined, markdown};
use crate::cli::Common;
use std::io::Write;
use std::path::PathBuf;

/// Write one page of the records of many folders: shards of a sweep, or several devices, which are kept apart
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folders that hedgerow bench, accel, animate or fly wrote
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<PathBuf>,
    /// The folder for the records together, charts and index.html
    #[arg(short, long, value_name = "DIR", required_unless_present = "markdown")]
    output: Option<PathBuf>,
    /// Write the records of hedgerow bench to a page of Markdown, such as docs/results.md
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
}

pub(crate) fn run(_common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(output) = &arguments.output {
        let page = joined::write(&arguments.folders, output)?;
        writeln!(std::io::stdout().lock(), "{}", page.display())?;
    }
    if let Some(path) = &arguments.markdown {
        markdown::write(&arguments.folders, path)?;
        writeln!(std::io::stdout().lock(), "{}", path.display())?;
    }
    Ok(())
}
