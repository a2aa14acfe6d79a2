//! What sections say of rays through structures with a flag and without it.

use crate::experiments::accel::points::FlaggedRays;
use crate::report::SERIES;
use crate::report::bars::Bar;
use crate::report::numbers::three_digits;
use crate::subjects::queries::MeanWork;
use maud::{Markup, html};

/// The gain of each kind of ray: as bars, and in words.
pub(super) fn gains(all: &[FlaggedRays]) -> (Vec<Bar>, String) {
    let bar = |(i, rays): (usize, &FlaggedRays)| Bar {
        label: rays.rays.clone(),
        figure: three_digits(rays.gain.median),
        spread: rays.gain,
        tone: SERIES[i % SERIES.len()],
    };
    let bars: Vec<Bar> = all.iter().enumerate().map(bar).collect();
    let in_words: Vec<String> = bars.iter().map(|bar| format!("{} {}", bar.label, bar.figure)).collect();
    (bars, in_words.join("; "))
}

/// Millions of rays a second.
pub(super) fn mrays_s(rays: &FlaggedRays, milliseconds: f64) -> Option<f64> {
    Some(rays.count as f64 / (milliseconds * 1e3))
}

/// A cell: a part of the work without the flag, and with it.
pub(super) fn both(rays: &FlaggedRays, of: fn(&MeanWork) -> f64) -> Markup {
    let [off, on] = [of(&rays.off_work), of(&rays.on_work)];
    html! { td.number data-value=(on) { (three_digits(off)) " → " (three_digits(on)) } }
}
