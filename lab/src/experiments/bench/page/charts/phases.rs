//! Where the time of a build goes: its phases as stacked bars, one bar a builder.

use crate::Result;
use crate::measure::record::{PhaseRecord, Record};
use crate::report::chart::{Caption, Chart};
use crate::report::names::{short, slug};
use crate::report::stacked::{Part, Stack, stacked};
use crate::report::theme::Legend;

const READING: &str = "One bar a builder, its phases from left to right in the order in which they run. The table below says \
    how far each is from the time that a plain copy of the bytes it must move would take.";

/// The phases of every builder on one scene, as far as builders report them. `None` if none does.
///
/// # Errors
/// The chart cannot be drawn.
pub fn phases(records: &[&Record], legend: &Legend) -> Result<Option<Chart>> {
    let Some(scene) = records.first().map(|record| &record.scene) else { return Ok(None) };
    let part = |phase: &PhaseRecord| Part {
        name: phase.name.clone(),
        milliseconds: phase.median_ms,
        tone: legend.phase(&phase.name),
    };
    let stack = |record: &Record| Stack {
        name: short(&record.builder),
        tone: legend.builder(&record.builder),
        total: record.build.median_ms,
        parts: record.build.phases.iter().map(part).collect(),
    };
    let stacks: Vec<Stack> = records.iter().filter(|r| !r.build.phases.is_empty()).map(|r| stack(r)).collect();
    let caption = Caption {
        name: format!("{}-phases", slug(scene)),
        title: format!("{scene}: where the build time goes"),
        alt: stacks.iter().map(Stack::in_words).collect::<Vec<_>>().join("; "),
        reading: READING.into(),
    };
    stacked(caption, "milliseconds", "build", &stacks)
}
