//! `growth.html`: what a far triangle costs.

use super::losses::{Loss, short_codes, tone};
use super::stretched::{Losses, Row, StretchPage};
use crate::experiments::stability::drop;
use crate::experiments::stability::far::{FarTriangle, Side};
use crate::experiments::stability::points::Growth;
use crate::report::Mark;
use crate::report::beside::{GROWTH, Page};
use crate::report::numbers::{three_digits, tick};
use crate::report::theme::MUTED;
use maud::{Markup, html};

fn of_builder<'p>(points: &[&'p Growth], builder: &str) -> Vec<&'p Growth> {
    points.iter().copied().filter(|point| point.builder == builder).collect()
}

/// Where the thesis expects a builder to lose a tenth: as far behind the same builder without a grid as equation 13 says.
fn expected(points: &[&Growth], builder: &str) -> Option<f64> {
    let axes = points.first()?.by.axes;
    let base = drop::base(builder)?;
    let lost = Loss::of_cost(&of_builder(points, &base)).e()?;
    Some(f64::from(lost) + drop::shift(builder, axes)?)
}

fn has_expected(points: &[Growth]) -> bool {
    points.iter().any(|point| drop::shift(&point.builder, 1).is_some())
}

impl StretchPage for FarTriangle {
    const PAGE: Page = GROWTH;
    const COMMAND: &'static str = "hedgerow stability growth";
    const TITLE: [&'static str; 2] = [
        "Growing bounds",
        "One far triangle makes the bounds of a scene 2^e times as long, in one axis or in three, to one side or the other. Codes \
         spend their bits on the distance, and what stays of the scene is told apart by fewer: how far does each builder go?",
    ];

    fn reading(points: &[Growth]) -> Markup {
        html! {
            @if has_expected(points) {
                "Expected is where the thesis moves the drop of " code { (drop::BASE) } " by log2(cells) / axes (Riemersma 2024, equations 13 and 14)."
            }
        }
    }

    fn terms() -> Markup {
        html! {
            dt { "The far triangle" }
            dd {
                "For bounds from lo to hi, its box reaches from lo + (hi − lo) · 2^e · (1 − 10⁻⁶) to lo + (hi − lo) · 2^e in the axes that "
                "grow, and takes the last thousandth of the others; to the negative side, mirrored. Where that is beyond the largest float, there "
                "is no point."
            }
            dt { "Relative cost" }
            dd {
                "(3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the scene without the far triangle, every box clipped to "
                "that scene; over the same at e = 0. Trees of peers are not ours to walk: they have speeds alone."
            }
            dt { "Relative speed" }
            dd {
                "Rays of the scene without the far triangle, traced through both structures in turn, e = 0 and e, after a warm-up that does not "
                "count; the median of the ratios run by run. Hits of the two are compared, and brute force decides where they differ. A kind of ray that has "
                "fallen below a twentieth is not measured further on."
            }
            dt { "Rays" }
            dd {
                b { "primary" } " through the camera's pixels; from what they hit: " b { "diffuse1" } " one cosine-weighted bounce (global "
                "illumination), " b { "ao" } " four short rays around the normal, " b { "shadow" } " to a square light."
            }
        }
    }

    fn slug(&self) -> String {
        format!("{}-{}", self.axes, if self.side == Side::Positive { "plus" } else { "minus" })
    }

    fn own_columns<'p>(table: Losses<'p, Self>) -> Losses<'p, Self> {
        table
            .number("axes", "", |row| Some(row.own[0].by.axes.into()), tick)
            .text("side", |row| row.own[0].by.side.name())
    }

    fn more_columns<'p>(mut table: Losses<'p, Self>, points: &[Growth]) -> Losses<'p, Self> {
        if has_expected(points) {
            table = table.number("expected", "e", |row| expected(&row.all, row.builder), tick);
            let later =
                |row: &Row<'p, Self>| Some(f64::from(Loss::of_cost(&row.own).e()?) - expected(&row.all, row.builder)?);
            table = table.number("later by", "e", later, |v| format!("{v:+.1}"));
        }
        let greatest = |row: &Row<'p, Self>| row.own.iter().filter_map(|point| point.relative_cost).reduce(f64::max);
        table.number("greatest cost", "×", greatest, three_digits)
    }

    /// The measured drop of the codes without a grid, and where that of the others is expected.
    fn marks(points: &[&Growth], builders: &[&str]) -> Vec<Mark> {
        let mut marks: Vec<Mark> = Vec::new();
        for builder in builders {
            let Some(x) = expected(points, builder) else { continue };
            let base = drop::base(builder).unwrap_or_default();
            if let Some(e) = Loss::of_cost(&of_builder(points, &base)).e()
                && !marks.iter().any(|mark| mark.tone == MUTED)
            {
                marks.push(Mark { name: format!("{} loses 10%", drop::BASE), tone: MUTED, x: f64::from(e) });
            }
            marks.push(Mark { name: format!("{} expected", short_codes(builder)), tone: tone(builders, builder), x });
        }
        marks
    }
}
