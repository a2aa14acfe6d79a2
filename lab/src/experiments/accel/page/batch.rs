//! The section of batches.

use super::Part;
use crate::Result;
use crate::experiments::accel::points::{Batch, Implementation, Submission};
use crate::report::bars::{Bar, Bars};
use crate::report::numbers::{count, duration, duration_tick, grouped, short_count, three_digits, tick};
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Section, Table, Tone, bars, curves, distinct, document};
use crate::subjects::preference::Preference;
use maud::{Markup, html};

/// Builders and their ways, in the order of charts and tables, with its colour: ours begin with the first and the driver's with
/// the second, as on the whole page.
const SUBJECTS: [Subject; 8] = [
    (Some(Implementation::Ours), Submission::OneCall, SERIES[0]),
    (Some(Implementation::Ours), Submission::OneTable, SERIES[4]),
    (Some(Implementation::Ours), Submission::OneSubmit, SERIES[2]),
    (Some(Implementation::Ours), Submission::SubmitEach, SERIES[6]),
    (Some(Implementation::Driver), Submission::OneCall, SERIES[1]),
    (Some(Implementation::Driver), Submission::OneSubmit, SERIES[3]),
    (Some(Implementation::Driver), Submission::SubmitEach, SERIES[5]),
    (None, Submission::EmptySubmits, SERIES[8]),
];

type Subject = (Option<Implementation>, Submission, Tone);

/// The batches of each preference.
pub(super) fn by_preference(points: &[Batch]) -> Vec<Vec<&Batch>> {
    let all = distinct(points.iter().map(|point| point.prefer));
    all.into_iter().map(|prefer| points.iter().filter(|point| point.prefer == prefer).collect()).collect()
}

/// The point of this many structures.
pub(super) fn find<'p>(
    points: &[&'p Batch],
    structures: u32,
    maker: Option<Implementation>,
    way: Submission,
) -> Option<&'p Batch> {
    points.iter().copied().find(|point| point.structures == structures && point.maker == maker && point.way == way)
}

fn name(maker: Option<Implementation>, way: Submission) -> String {
    maker.map_or_else(|| way.name().to_owned(), |maker| format!("{}, {}", maker.name(), way.name()))
}

/// What builds prefer.
pub(super) fn in_words(prefer: Preference) -> &'static str {
    match prefer {
        Preference::FastTrace => "for fast traces",
        Preference::FastBuild => "for fast builds",
        Preference::None => "without a preference",
    }
}

/// A section for each preference.
pub(super) fn parts(points: &[Batch]) -> Result<Vec<Part>> {
    by_preference(points).iter().map(|own| part(own)).collect()
}

/// That of some points, all of one preference.
fn part(points: &[&Batch]) -> Result<Part> {
    let prefer = points[0].prefer;
    let most = points.iter().map(|point| point.structures).max().unwrap_or(0);
    let triangles = points.iter().find(|point| point.structures == most).map_or(0, |point| point.triangles);
    let bar = |&(maker, way, tone): &Subject| {
        let point = find(points, most, maker, way)?;
        let time = duration(point.wall_ms.median);
        let ratio = three_digits(point.over_our_call.median);
        let is_base = (maker, way) == (Some(Implementation::Ours), Submission::OneCall);
        let figure = if is_base { time } else { format!("{time} ({ratio} ×)") };
        Some(Bar { label: name(maker, way), figure, spread: point.wall_ms, tone })
    };
    let all_bars: Vec<Bar> = SUBJECTS.iter().filter_map(bar).collect();
    let told: Vec<String> = all_bars.iter().map(|bar| format!("{}: {}", bar.label, bar.figure)).collect();
    let caption = Caption {
        name: format!("accel-batch-{prefer}"),
        title: format!("{} structures of 12 to 478 triangles, {}", grouped(most.into()), in_words(prefer)),
        alt: told.join("; "),
        reading:
            "Shorter is better; the line through a bar goes from the fastest to the slowest run. In brackets: how many \
                  times as long as one call of ours, in the median of the runs."
                .into(),
    };
    let bars = bars::bars(
        caption,
        &Bars { bars: all_bars, axis: "wall-clock milliseconds", number: tick, marks: Vec::new() },
    )?;
    let curve = |&(maker, way, tone): &Subject| {
        let own = points.iter().filter(|point| (point.maker, point.way) == (maker, way));
        let points = own.map(|point| (f64::from(point.structures), point.wall_ms)).collect();
        Curve { name: name(maker, way), tone, points, law: None }
    };
    let all: Vec<Curve> = SUBJECTS.iter().map(curve).filter(|curve| !curve.points.is_empty()).collect();
    let caption = Caption {
        name: format!("accel-batch-{prefer}-growth"),
        title: format!("Time over the number of structures, {}", in_words(prefer)),
        alt: all.iter().map(|curve| curve.name.clone()).collect::<Vec<_>>().join("; "),
        reading:
            "Both axes are logarithmic. Where lines lie together, it makes no difference how the builds are asked for."
                .into(),
    };
    let growth = curves::curves(
        caption,
        &all,
        &Axis { name: "structures", is_log: true, number: short_count },
        &Axis { name: "wall clock", is_log: true, number: duration_tick },
    )?;
    let charts: Vec<Chart> = bars.into_iter().chain(growth).collect();
    let body = html! {
        p {
            "Engines build hundreds of small structures a frame. Here " (grouped(most.into())) " of them, "
            (grouped(triangles)) " triangles together, " (in_words(prefer)) ", are built in one call, ours also with the arguments in memory in place of push "
            "constants; in a call each with a barrier behind it, in one "
            "command buffer; and in a call each that is submitted and waited for. By the wall's clock, recording included."
        }
        p { (reading(points, most)) }
        (document::charts(&charts))
        details {
            summary { "All figures" }
            (every_batch(points))
        }
    };
    Ok((Section::new(format!("batches-{prefer}"), format!("Batches, {}", in_words(prefer)), body), charts))
}

fn every_batch(points: &[&Batch]) -> Markup {
    let each = |point: &Batch| 1e3 * point.wall_ms.median / f64::from(point.structures);
    Table::new("Batches", points)
        .number("structures", "", |point| Some(point.structures.into()), count)
        .text("whose", |point| point.maker.map_or("–", Implementation::name))
        .text("how", |point| point.way.name())
        .number("triangles", "", |point| Some(point.triangles as f64), count)
        .spread("time", "ms", |point| Some(point.wall_ms), three_digits)
        .number("a structure", "µs", move |point| Some(each(point)), three_digits)
        .spread("over one call, ours", "×", |point| Some(point.over_our_call), three_digits)
        .html()
}

/// One call of ours against the others, in a sentence.
fn reading(points: &[&Batch], most: u32) -> String {
    let of = |maker, way| find(points, most, Some(maker), way);
    let Some(ours) = of(Implementation::Ours, Submission::OneCall) else { return String::new() };
    let mut text = format!("One call takes {}", duration(ours.wall_ms.median));
    if let Some(table) = of(Implementation::Ours, Submission::OneTable) {
        text += &format!(", with the arguments in memory {} of that", three_digits(table.over_our_call.median));
    }
    let singly = [Submission::OneSubmit, Submission::SubmitEach].map(|way| of(Implementation::Ours, way));
    if let [Some(one_submit), Some(submit_each)] = singly {
        let [in_one, each] = [one_submit, submit_each].map(|point| three_digits(point.over_our_call.median));
        text +=
            &format!("; calls one by one take {in_one} times as long in one submit, and {each} times in a submit each");
    }
    if let Some(drivers) = of(Implementation::Driver, Submission::OneCall) {
        let ratio = drivers.over_our_call.median;
        text += &match ratio >= 1.0 {
            true => format!(". The driver's batch takes {} times as long as ours", three_digits(ratio)),
            false => format!(". Ours is slower than the driver's batch: {} times its time", three_digits(1.0 / ratio)),
        };
    }
    text + "."
}
