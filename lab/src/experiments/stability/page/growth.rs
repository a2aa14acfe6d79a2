//! `growth.html`: what a far triangle costs.

use super::losses::{Loss, OverE, Titled, cost_chart, different, kinds, short_codes, speed_chart, tone};
use super::{Paged, Section};
use crate::Result;
use crate::experiments::stability::drop;
use crate::experiments::stability::far::Side;
use crate::experiments::stability::growth::{in_axes, on_side};
use crate::experiments::stability::points::Growth;
use crate::report::beside::{GROWTH, Page};
use crate::report::curves::Mark;
use crate::report::elements::{column, number, scroll};
use crate::report::names::slug;
use crate::report::numbers::{three_digits, tick};
use crate::report::theme::MUTED;
use maud::{Markup, html};
use std::collections::BTreeMap;

impl OverE for Growth {
    fn builder(&self) -> &str {
        &self.builder
    }
    fn e(&self) -> u32 {
        self.e
    }
    fn relative_cost(&self) -> Option<f64> {
        self.relative_cost
    }
    fn relative_mrays(&self) -> &BTreeMap<String, f64> {
        &self.relative_mrays
    }
}

/// The points of a scene that grow in one manner.
fn in_manner<'p>(points: &'p [Growth], scene: &str, (axes, side): (u32, Side)) -> Vec<&'p Growth> {
    points.iter().filter(|p| p.scene == scene && p.axes == axes && p.side == side).collect()
}

fn of_builder<'p>(points: &[&'p Growth], builder: &str) -> Vec<&'p Growth> {
    points.iter().copied().filter(|point| point.builder == builder).collect()
}

/// Where the thesis expects a builder to lose a tenth: as far behind the same builder without a grid as equation 13 says.
fn expected(points: &[&Growth], builder: &str) -> Option<f64> {
    let axes = points.first()?.axes;
    let base = drop::base(builder)?;
    let lost = Loss::of_cost(&of_builder(points, &base)).e()?;
    Some(f64::from(lost) + drop::shift(builder, axes)?)
}

impl Paged for Growth {
    const PAGE: Page = GROWTH;
    const TITLE: [&'static str; 2] = [
        "Growing bounds",
        "One far triangle makes the bounds of a scene 2^e times as long, in one axis or in three, to one side or the other. Codes \
         spend their bits on the distance, and what stays of the scene is told apart by fewer: how far does each builder go?",
    ];

    fn failures(_: &[Growth]) -> Vec<String> {
        Vec::new()
    }

    fn summary(points: &[Growth]) -> Markup {
        let has_expected = points.iter().any(|point| drop::shift(&point.builder, 1).is_some());
        html! {
            p {
                "The first e at which the scene costs a tenth more than at e = 0, or its rays have lost a tenth of their speed at two points in a row; later is better."
                @if has_expected {
                    " Expected is where the thesis moves the drop of " code { (drop::BASE) } " by log2(cells) / axes (Riemersma 2024, equations 13 and 14)."
                }
            }
            (scroll("Where each loses a tenth", losses(points)))
        }
    }

    fn sections(points: &[Growth]) -> Result<Vec<Section>> {
        let builders = different(points, |point| point.builder.as_str());
        let mut sections = Vec::new();
        for scene in different(points, |point| point.scene.as_str()) {
            let (mut charts, mut more) = (Vec::new(), Vec::new());
            let of_scene: Vec<&Growth> = points.iter().filter(|point| point.scene == scene).collect();
            for manner @ (axes, side) in different(&of_scene, |point| (point.axes, point.side)) {
                let grown = in_manner(points, scene, manner);
                let end = if side == Side::Positive { "plus" } else { "minus" };
                let name = format!("growth-{}-{axes}-{end}", slug(scene));
                let title = format!("{scene}, {} {}", in_axes(axes), on_side(side));
                let titled = Titled { name: &name, title: &title };
                charts.extend(cost_chart(&grown, &builders, &marks(&grown, &builders), &titled)?);
                charts.extend(speed_chart(&grown, &builders, None, &titled)?);
                for kind in kinds(points) {
                    more.extend(speed_chart(&grown, &builders, Some(kind), &titled)?);
                }
            }
            sections.push(Section {
                id: format!("scene-{}", slug(scene)),
                title: scene.to_owned(),
                charts,
                above: html! {},
                below: html! {},
                more,
            });
        }
        Ok(sections)
    }

    fn method() -> Markup {
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

fn losses(points: &[Growth]) -> Markup {
    let kinds = kinds(points);
    let has_expected = points.iter().any(|point| drop::shift(&point.builder, 1).is_some());
    html! {
        table.sortable #losses {
            caption.hidden { "Where each loses a tenth" }
            thead { tr {
                (column("scene", "", false)) (column("builder", "", false)) (column("axes", "", true)) (column("side", "", false))
                (column("cost", "e", true))
                @if has_expected { (column("expected", "e", true)) (column("later by", "e", true)) }
                (column("greatest cost", "×", true))
                @for kind in &kinds { (column(kind, "e", true)) }
            } }
            tbody {
                @for scene in different(points, |point| point.scene.as_str()) {
                    @for manner in different(points, |point| (point.axes, point.side)) {
                        @let grown = in_manner(points, scene, manner);
                        @for builder in different(&grown, |point| point.builder.as_str()) {
                            (loss(&grown, builder, &kinds, has_expected))
                        }
                    }
                }
            }
        }
    }
}

fn loss(grown: &[&Growth], builder: &str, kinds: &[&str], has_expected: bool) -> Markup {
    let own = of_builder(grown, builder);
    let Some(first) = own.first() else { return html! {} };
    let cost = Loss::of_cost(&own);
    let expected = expected(grown, builder);
    let later = cost.e().zip(expected).map(|(e, expected)| f64::from(e) - expected);
    let greatest = own.iter().filter_map(|point| point.relative_cost).reduce(f64::max);
    html! {
        tr {
            th scope="row" data-value=(first.scene) { (first.scene) }
            td.builder data-value=(builder) title=(builder) { (short_codes(builder)) }
            (number(Some(first.axes.into()), tick))
            td data-value=(first.side.sign()) { (first.side.sign()) }
            (cost.cell())
            @if has_expected { (number(expected, tick)) (number(later, |v| format!("{v:+.1}"))) }
            (number(greatest, three_digits))
            @for kind in kinds { (Loss::of_speed(&own, kind).cell()) }
        }
    }
}
