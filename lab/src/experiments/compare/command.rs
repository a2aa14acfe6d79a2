//! `hedgerow compare`: two runs side by side, with what may be noise marked.

use crate::cli::Common;
use crate::experiments::bench::results;
use crate::experiments::compare::{self, Change, Comparison};
use crate::measure::statistics::geometric_mean;
use crate::report::names::{distinct, short};
use crate::report::numbers::{duration, three_digits};
use crate::report::table::{or_dash, with_header};
use comfy_table::Table;
use std::io::Write;
use std::path::PathBuf;

/// Compare two runs of `bench`: ratios of build time, trace speed and SAH cost, and what of it may be noise
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The older results.jsonl, or the folder it is in
    old: PathBuf,
    /// The newer
    new: PathBuf,
}

pub(crate) fn run(_common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    let (old, new) = (results::read(&arguments.old)?, results::read(&arguments.new)?);
    let found = compare::compare(&old, &new);
    for doubt in &found.doubts {
        eprintln!("hedgerow: warning: {doubt}");
    }
    if found.pairs.is_empty() {
        anyhow::bail!(
            "{} and {} have no builder on the same scene in common; measure the same with both",
            arguments.old.display(),
            arguments.new.display()
        );
    }
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", table(&found.pairs))?;
    let mean = |of: fn(&Comparison) -> Vec<f64>| geometric_mean(found.pairs.iter().flat_map(of));
    writeln!(
        out,
        "mean over {}: build time × {}, trace speed × {}, SAH cost × {}",
        found.pairs.len(),
        or_dash(mean(|p| vec![p.build_ms.ratio()]), three_digits),
        or_dash(mean(|p| p.mrays_s.iter().map(|(_, change)| change.ratio()).collect()), three_digits),
        or_dash(mean(|p| p.sah.iter().map(Change::ratio).collect()), three_digits),
    )?;
    writeln!(out, "~ the change is inside the noise: the spreads of the runs meet")?;
    for (which, names) in [("old", &found.only_old), ("new", &found.only_new)] {
        if !names.is_empty() {
            writeln!(out, "only in the {which} run: {}", names.join("; "))?;
        }
    }
    Ok(())
}

fn table(pairs: &[Comparison]) -> Table {
    let kinds = distinct(pairs.iter().flat_map(|p| &p.mrays_s).map(|(kind, _)| kind.as_str()));
    let header = ["scene", "builder", "build old", "new", "time ×", "SAH ×"];
    let mut table = with_header(header.into_iter().chain(kinds.iter().copied()), 2);
    for pair in pairs {
        let speed = |kind: &&str| or_dash(pair.mrays_s.iter().find(|(k, _)| k == kind), |(_, change)| ratio(change));
        let figures = [
            pair.scene.clone(),
            short(&pair.builder),
            duration(pair.build_ms.old),
            duration(pair.build_ms.new),
            ratio(&pair.build_ms),
            or_dash(pair.sah, |change| format!("{:.4}", change.ratio())),
        ];
        table.add_row(figures.into_iter().chain(kinds.iter().map(speed)));
    }
    table
}

/// The ratio, with `~` before it if it may be noise.
fn ratio(change: &Change) -> String {
    format!("{}{:.3}", if change.is_noise { "~" } else { "" }, change.ratio())
}
