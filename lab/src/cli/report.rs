//! `hedgerow report`: one page of the records of many folders.

use super::Common;
use crate::report::joined;
use std::io::Write;
use std::path::PathBuf;

/// Write one page of the records of many folders: shards of a sweep, or several devices, which are kept apart
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folders that hedgerow bench, accel or animate wrote
    #[arg(value_name = "DIR", required = true)]
    folders: Vec<PathBuf>,
    /// The folder for the records together, charts and index.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(super) fn run(_common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let page = joined::write(&arguments.folders, &arguments.output)?;
    writeln!(std::io::stdout().lock(), "{}", page.display())?;
    Ok(())
}
