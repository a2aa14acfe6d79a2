//! `accel.jsonl` and `accel.html`: what `hedgerow accel` measures, as programs read it and as people do.
//!
//! The page follows from the records alone: anyone who has them can write it again, and `hedgerow bench` does, so that the pages
//! name each other.

mod any_hit;
mod batch;
mod flagged;
mod goals;
mod memory;
mod rebraid;
mod top_level;
mod update;

use crate::Result;
use crate::experiments::accel::points::{
    AccelEntry, AnyHitPoint, Batch, Implementation, MemoryPoint, RebraidPoint, TopLevel, Update,
};
use crate::measure::{Failure, Setting, Spread};
use crate::report::numbers::three_digits;
use crate::report::{Chart, Curve, Document, Section, Table, Tone, beside, document, lines};
use goals::Goal;
use maud::{Markup, html};
use std::path::{Path, PathBuf};

impl lines::Entry for AccelEntry {
    const FILE: &'static str = beside::ACCEL.records;
    const COMMAND: &'static str = "hedgerow accel";
}

/// `accel.jsonl`, open for writing.
pub type Points = lines::Points<AccelEntry>;

/// The lines of an `accel.jsonl`, or of the one in a folder.
///
/// # Errors
/// The file cannot be read; a line is not a record of this schema.
pub fn read(path: &Path) -> Result<Vec<AccelEntry>> {
    lines::entries(path)
}

/// The records, by what they are of.
#[derive(Debug, Default)]
struct Measured {
    setting: Option<Setting>,
    batches: Vec<Batch>,
    top_levels: Vec<TopLevel>,
    rebraids: Vec<RebraidPoint>,
    any_hits: Vec<AnyHitPoint>,
    updates: Vec<Update>,
    memories: Vec<MemoryPoint>,
    failures: Vec<Failure>,
}

/// Writes `accel.html` and its charts into `folder`, from the `accel.jsonl` there; gives the page's path. The page names the
/// others that lie there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let mut measured = Measured::default();
    for entry in read(folder)? {
        match entry {
            AccelEntry::Setting(setting) => measured.setting = Some(setting),
            AccelEntry::Batch(point) => measured.batches.push(point),
            AccelEntry::Tlas(point) => measured.top_levels.push(point),
            AccelEntry::Rebraid(point) => measured.rebraids.push(point),
            AccelEntry::AnyHit(point) => measured.any_hits.push(point),
            AccelEntry::Update(point) => measured.updates.push(point),
            AccelEntry::Memory(point) => measured.memories.push(point),
            AccelEntry::Failure(failure) => measured.failures.push(failure),
        }
    }
    let setting = measured.setting.as_ref();
    let parts = [
        top_level::part(&measured.top_levels)?,
        rebraid::part(&measured.rebraids)?,
        any_hit::part(&measured.any_hits)?,
        update::part(&measured.updates)?,
        memory::part(&measured.memories)?,
    ];
    let parts = batch::parts(&measured.batches)?.into_iter().chain(parts.into_iter().flatten());
    let (parts, charts): (Vec<Section>, Vec<Vec<Chart>>) = parts.unzip();
    let mut sections = vec![Section::new("summary", "Summary", summary(setting, &goals::goals(&measured)))];
    sections.extend(parts);
    sections.push(Section::method(Some(beside::ACCEL.records), terms()));
    let document = Document {
        tab: "batches, top levels, re-braiding, updates".into(),
        kicker: "hedgerow benchmark",
        title: "Structures as engines use them".into(),
        lead: "Batches of small builds, top levels of many instances, re-braiding, orders of children, and updates, through the calls of \
               VK_KHR_acceleration_structure: ours in compute shaders, and the driver's by the same calls, in turn in one process."
            .into(),
        setting,
        failures: document::told(&measured.failures),
        sections,
    };
    document.write(folder, &beside::ACCEL, charts.iter().flatten())
}

/// What an experiment has on the page, and its charts.
type Part = (Section, Vec<Chart>);

/// What is drawn of one maker's points: what it is called behind the maker's name, its colour, and the figure.
type Series<'f, P> = (Implementation, &'f str, Tone, &'f dyn Fn(&P) -> Option<Spread>);

/// A curve of each of `series` that has points; `place` gives whose a point is, and where on the horizontal axis.
fn curves_of<P>(points: &[&P], place: fn(&P) -> (Implementation, u32), series: &[Series<'_, P>]) -> Vec<Curve> {
    let curve = |&(maker, what, tone, figure): &Series<'_, P>| {
        let of_maker = points.iter().map(|point| (place(point), point)).filter(|((whose, _), _)| *whose == maker);
        let points = of_maker.filter_map(|((_, x), point)| Some((f64::from(x), figure(point)?))).collect();
        Curve { name: format!("{} {what}", maker.name()), tone, points, law: None }
    };
    series.iter().map(curve).filter(|curve| !curve.points.is_empty()).collect()
}

fn summary(setting: Option<&Setting>, goals: &[Goal]) -> Markup {
    let (met, all) = (goals.iter().filter(|goal| goal.is_met()).count(), goals.len());
    html! {
        @if goals.is_empty() { p { "Nothing that has a goal was measured." } } @else {
            p {
                "Goals met: " (met) " of " (all) ". Ratios of times, in the median of the runs and from the least to the greatest: above 1, "
                "the first is faster. Those over all kinds of rays are geometric means, from the kind that gains least to that which gains "
                "most."
            }
        }
        @for note in setting.map_or(&[][..], |setting| &setting.notes) { p.note { (note) } }
        @if !goals.is_empty() { (goal_table(goals)) }
    }
}

fn goal_table(goals: &[Goal]) -> Markup {
    Table::new("Goals", goals)
        .id("goals")
        .name("what", |goal| &goal.what)
        .spread("is", "×", |goal| Some(goal.ratio), three_digits)
        .number("shall be at least", "×", |goal| Some(goal.least), three_digits)
        .cell("verdict", |goal| {
            let verdict = goal.verdict();
            html! { td .met[goal.is_met()] .wrong[!goal.is_met()] data-value=(verdict) { (verdict) } }
        })
        .html()
}

fn terms() -> Markup {
    html! {
        dt { "In turn" }
        dd {
            "Everything that is compared runs in turn in one process, A B A B, after a warm-up that does not count. Ratios are taken run "
            "by run, so that what slows down a run slows both."
        }
        dt { "Times" }
        dd {
            "Of batches by the wall's clock, from before the recording of the commands to behind the wait for them. Each submit has a command "
            "pool and a fence of its own; what that takes stands beside them as empty submits. All others by the device's timestamps."
        }
        dt { "The driver" }
        dd {
            "Its own structures, built by the same structs with the same flags, and traced by ray queries in the same shader as ours."
        }
        dt { "Rays" }
        dd {
            b { "primary" } " through the camera's pixels; from what they hit: " b { "shadow" } " to the lights, " b { "ao" }
            " four short rays around the normal, " b { "diffuse1" } " one cosine-weighted bounce and " b { "diffuse2" } " the next, "
            b { "reflection" } " the mirror direction; " b { "random" } " between points of the sphere around the scene."
        }
        dt { "SAH cost" }
        dd { "Expected work of a random ray: (3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the root." }
    }
}
