//! `large.html`: what huge triangles at the edge of a scene cost, by the bounds that codes are normalised by.

use super::losses::{Loss, OverE, Titled, cost_chart, different, kinds, short_codes, speed_chart};
use super::{Paged, Section};
use crate::Result;
use crate::experiments::stability::large::Placement;
use crate::experiments::stability::points::Large;
use crate::report::beside::{LARGE, Page};
use crate::report::elements::{column, number, scroll};
use crate::report::names::slug;
use crate::report::numbers::{three_digits, tick};
use maud::{Markup, html};
use std::collections::BTreeMap;

impl OverE for Large {
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

fn placed<'p>(points: &'p [Large], scene: &str, (placement, count): (Placement, u32)) -> Vec<&'p Large> {
    points.iter().filter(|p| p.scene == scene && p.placement == placement && p.count == count).collect()
}

/// The point of the same builder with the bounds of all boxes, if this one has others (`+concise`).
fn with_full_bounds<'p>(points: &[&'p Large], point: &Large) -> Option<&'p Large> {
    let (before, rest) = point.builder.split_once('+')?;
    let behind = rest.find([':', '/']).map_or("", |at| &rest[at..]);
    let full = format!("{before}{behind}");
    points.iter().copied().find(|p| p.builder == full && p.e == point.e)
}

impl Paged for Large {
    const PAGE: Page = LARGE;
    const TITLE: [&'static str; 2] = [
        "Large triangles at the edge",
        "Huge triangles at the edge of a scene stretch the bounds that codes are normalised by. Concise bounds cut off what no centroid \
         needs, the same from both sides: what do they save, and where nothing?",
    ];

    fn failures(_: &[Large]) -> Vec<String> {
        Vec::new()
    }

    fn summary(points: &[Large]) -> Markup {
        html! {
            p {
                "The first e at which the scene costs a tenth more than at e = 0, or its rays have lost a tenth of their speed at two points in a row; later is better. "
                "Beside it the cost at the greatest e, and that over the same codes' with the bounds of all boxes: below 1, narrower bounds save."
            }
            (scroll("Where each loses a tenth", losses(points)))
        }
    }

    fn sections(points: &[Large]) -> Result<Vec<Section>> {
        let builders = different(points, |point| point.builder.as_str());
        let mut sections = Vec::new();
        for scene in different(points, |point| point.scene.as_str()) {
            let (mut charts, mut more) = (Vec::new(), Vec::new());
            let of_scene: Vec<&Large> = points.iter().filter(|point| point.scene == scene).collect();
            for manner @ (placement, count) in different(&of_scene, |point| (point.placement, point.count)) {
                let own = placed(points, scene, manner);
                let name = format!("large-{}-{placement}-{count}", slug(scene));
                let title = format!(
                    "{scene}, {}, {}",
                    placement.what(),
                    if count == 1 { "one each".into() } else { format!("{count} each") }
                );
                let titled = Titled { name: &name, title: &title };
                charts.extend(cost_chart(&own, &builders, &[], &titled)?);
                charts.extend(speed_chart(&own, &builders, None, &titled)?);
                for kind in kinds(points) {
                    more.extend(speed_chart(&own, &builders, Some(kind), &titled)?);
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
            dt { "The huge triangles" }
            dd {
                "Each is flat in one axis and 2^e times as long as the scene in the others. " b { "wall" } ": at the positive end of x, its middle "
                "beside the scene's. " b { "walls" } ": the same at both ends of every axis. " b { "outward" } ": one in each plane, from the "
                "corner of greatest coordinates away from the scene. Several of a kind stand a thousandth of the scene's length apart."
            }
            dt { "Bounds" }
            dd {
                "Codes are normalised by the bounds of all boxes; with " code { "+concise" } " by those less what no centroid needs, the same "
                "from both sides of an axis (Riemersma 2024, equation 15)."
            }
            dt { "Relative cost" }
            dd {
                "(3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the scene without the huge triangles, every box clipped "
                "to that scene; over the same at e = 0, where they are as long as the scene."
            }
            dt { "Relative speed" }
            dd {
                "Rays of the scene without the huge triangles, through both structures in turn, e = 0 and e, after a warm-up that does not count; "
                "the median of the ratios run by run. A kind of ray that has "
                "fallen below a twentieth is not measured further on."
            }
        }
    }
}

fn losses(points: &[Large]) -> Markup {
    let kinds = kinds(points);
    html! {
        table.sortable #losses {
            caption.hidden { "Where each loses a tenth" }
            thead { tr {
                (column("scene", "", false)) (column("triangles", "", false)) (column("a side", "", true)) (column("builder", "", false))
                (column("cost", "e", true)) (column("cost at the end", "×", true)) (column("over full bounds'", "×", true))
                @for kind in &kinds { (column(kind, "e", true)) }
            } }
            tbody {
                @for scene in different(points, |point| point.scene.as_str()) {
                    @for manner in different(points, |point| (point.placement, point.count)) {
                        @let own = placed(points, scene, manner);
                        @for builder in different(&own, |point| point.builder.as_str()) { (loss(&own, builder, &kinds)) }
                    }
                }
            }
        }
    }
}

fn loss(placed: &[&Large], builder: &str, kinds: &[&str]) -> Markup {
    let own: Vec<&Large> = placed.iter().copied().filter(|point| point.builder == builder).collect();
    let Some(last) = own.iter().max_by_key(|point| point.e) else { return html! {} };
    let saved = with_full_bounds(placed, last).and_then(|full| Some(last.cost? / full.cost?));
    html! {
        tr {
            th scope="row" data-value=(last.scene) { (last.scene) }
            td data-value=(last.placement) { (last.placement) }
            (number(Some(last.count.into()), tick))
            td.builder data-value=(builder) title=(builder) { (short_codes(builder)) }
            (Loss::of_cost(&own).cell())
            (number(last.relative_cost, three_digits))
            (number(saved, three_digits))
            @for kind in kinds { (Loss::of_speed(&own, kind).cell()) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::stability::points::Head;

    #[test]
    fn narrower_bounds_are_held_against_the_full_ones_of_the_same_codes() {
        let point = |builder: &str, e| Large {
            head: Head::of::<Large>(),
            scene: "s".into(),
            builder: builder.into(),
            placement: Placement::Wall,
            count: 1,
            e,
            cost: Some(1.0),
            relative_cost: Some(1.0),
            relative_mrays: BTreeMap::new(),
        };
        let full = [
            point("lbvh:codes=mc63:collapse=off", 2),
            point("lbvh:codes=mc63/40", 2),
            point("lbvh:codes=mc63:collapse=off", 4),
        ];
        let all: Vec<&Large> = full.iter().collect();
        let found = |builder| with_full_bounds(&all, &point(builder, 2));
        assert_eq!(found("lbvh:codes=mc63+concise:collapse=off"), Some(&full[0]));
        assert_eq!(found("lbvh:codes=mc63+centroid/40"), Some(&full[1]));
        assert_eq!(found("lbvh:codes=mc63:collapse=off"), None, "it has the full bounds itself");
        assert_eq!(found("lbvh:codes=mc30+concise"), None, "the others were not measured");
    }
}
