//! `large.html`: what huge triangles at the edge of a scene cost, by the bounds that codes are normalised by.

use super::stretched::{Losses, Row, StretchPage};
use crate::experiments::stability::large::HugeTriangles;
use crate::experiments::stability::points::Large;
use crate::report::beside::{LARGE, Page};
use crate::report::numbers::{three_digits, tick};
use maud::{Markup, html};

/// The point of the same builder with the bounds of all boxes, if this one has others (`+concise`).
fn with_full_bounds<'p>(points: &[&'p Large], point: &Large) -> Option<&'p Large> {
    let (before, rest) = point.builder.split_once('+')?;
    let behind = rest.find([':', '/']).map_or("", |at| &rest[at..]);
    let full = format!("{before}{behind}");
    points.iter().copied().find(|p| p.builder == full && p.e == point.e)
}

impl StretchPage for HugeTriangles {
    const PAGE: Page = LARGE;
    const COMMAND: &'static str = "hedgerow stability large";
    const TITLE: [&'static str; 2] = [
        "Large triangles at the edge",
        "Huge triangles at the edge of a scene stretch the bounds that codes are normalised by. Concise bounds cut off what no centroid \
         needs, the same from both sides: what do they save, and where nothing?",
    ];

    fn reading(_: &[Large]) -> Markup {
        html! {
            "Beside it the cost at the greatest e, and that over the same codes' with the bounds of all boxes: below 1, narrower bounds save."
        }
    }

    fn terms() -> Markup {
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

    fn slug(&self) -> String {
        format!("{}-{}", self.placement, self.count)
    }

    fn own_columns<'p>(table: Losses<'p, Self>) -> Losses<'p, Self> {
        let table = table.text("triangles", |row| row.own[0].by.placement);
        table.number("a side", "", |row| Some(row.own[0].by.count.into()), tick)
    }

    fn more_columns<'p>(table: Losses<'p, Self>, _: &[Large]) -> Losses<'p, Self> {
        let saved = |row: &Row<'p, Self>| {
            let (last, full) = (row.last(), with_full_bounds(&row.all, row.last())?);
            Some(last.cost?? / full.cost??)
        };
        let table = table.number("cost at the end", "×", |row| row.last().relative_cost, three_digits);
        table.number("over full bounds'", "×", saved, three_digits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::stability::large::LargePlacement;
    use crate::experiments::stability::points::Experiment;
    use std::collections::BTreeMap;

    #[test]
    fn narrower_bounds_are_held_against_the_full_ones_of_the_same_codes() {
        let point = |builder: &str, e| Large {
            experiment: Experiment::Large,
            scene: "s".into(),
            builder: builder.into(),
            by: HugeTriangles { placement: LargePlacement::Wall, count: 1 },
            e,
            cost: Some(Some(1.0)),
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
