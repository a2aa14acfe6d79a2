//! `greedy.html`: what greedy trees cost beside the cheapest ones.

use super::Paged;
use super::stretched::other_experiment;
use crate::Result;
use crate::experiments::stability::points::{Experiment, Greedy, GreedyKind};
use crate::measure::Spread;
use crate::report::beside::{GREEDY, Page};
use crate::report::numbers::{count, tick};
use crate::report::power_law::PowerLaw;
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Section, Table, curves, distinct, document, lines};
use maud::{Markup, html};

/// Where the thesis extrapolates to, and what it finds there.
const FAR: (f64, f64) = (1000.0, 2.5);

impl lines::Entry for Greedy {
    const FILE: &'static str = GREEDY.records;
    const COMMAND: &'static str = "hedgerow stability greedy";

    fn fault(&self) -> Option<String> {
        other_experiment(self.experiment, Experiment::Greedy)
    }
}

/// All scenes of a kind and a size.
struct Group<'p> {
    kind: GreedyKind,
    scene: Option<&'p str>,
    triangles: u32,
    /// By how much the greedy tree costs more than the optimum, in percent, from the least to the most.
    excess: Vec<f64>,
    /// Sets of the longest search.
    sets: u64,
}

impl Group<'_> {
    fn mean(&self) -> f64 {
        self.excess.iter().sum::<f64>() / self.excess.len() as f64
    }

    /// The least that no more than one in twenty exceed.
    fn high(&self) -> f64 {
        self.excess[(self.excess.len() * 95).div_ceil(100) - 1]
    }

    fn name(&self) -> String {
        self.scene.map_or(self.kind.name().to_owned(), |scene| format!("{scene}, {}", self.kind.name()))
    }

    /// The mean that the thesis has, in percent.
    fn published(&self) -> Option<f64> {
        match (self.kind, self.triangles) {
            (GreedyKind::Random, 3) => Some(0.5),
            (GreedyKind::Random, 15) => Some(5.0),
            (GreedyKind::Tetrahedra, 16) => Some(0.0),
            _ => None,
        }
    }
}

fn groups(points: &[Greedy]) -> Vec<Group<'_>> {
    distinct(points.iter().map(|point| (point.kind, point.scene.as_deref(), point.triangles)))
        .into_iter()
        .map(|(kind, scene, triangles)| {
            let own = || {
                points.iter().filter(move |p| p.kind == kind && p.scene.as_deref() == scene && p.triangles == triangles)
            };
            let mut excess: Vec<f64> = own().map(|point| 100.0 * (point.ratio() - 1.0)).collect();
            excess.sort_by(f64::total_cmp);
            Group { kind, scene, triangles, excess, sets: own().map(|point| point.sets).max().unwrap_or(0) }
        })
        .collect()
}

fn percent(value: f64) -> String {
    format!("{value:.2}")
}

/// How the mean over random scenes grows, in words; `None` where there are too few sizes to tell.
fn growth(groups: &[Group<'_>]) -> Option<String> {
    let random: Vec<&Group<'_>> = groups.iter().filter(|group| group.kind == GreedyKind::Random).collect();
    let means: Vec<(f64, f64)> =
        random.iter().filter(|g| g.triangles >= 15).map(|g| (f64::from(g.triangles), g.mean())).collect();
    let (law, last) = (PowerLaw::fit(&means)?, random.iter().max_by_key(|group| group.triangles)?);
    let (far, published) = FAR;
    let at_far = 1.0 + 0.01 * law.at(far);
    let slope = if law.exponent < 0.9 {
        "more slowly than the number of triangles"
    } else if law.exponent <= 1.1 {
        "with the number of triangles"
    } else {
        "faster than the number of triangles"
    };
    Some(format!(
        "From 15 triangles on, the excess of greedy trees over random ones grows {slope}, as n^{:.2}. At {} triangles it is {:.1}%. \
         The same law, far beyond what was measured, says a factor of {at_far:.2} at {far} triangles, where the thesis extrapolates \
         {published} along a line.",
        law.exponent,
        last.triangles,
        last.mean(),
    ))
}

fn chart(groups: &[Group<'_>]) -> Result<Option<Chart>> {
    let names = distinct(groups.iter().map(Group::name));
    let curve = |(name, tone): (&String, _)| {
        let own = groups.iter().filter(|group| group.name() == *name);
        let point = |group: &Group<'_>| {
            let (min, max) = (group.excess[0].max(0.0), group.high());
            let spread = Spread { median: group.mean(), min, max, runs: group.excess.len() as u32 };
            (f64::from(group.triangles), spread)
        };
        Curve { name: name.clone(), tone, points: own.map(point).collect(), law: None }
    };
    let all: Vec<Curve> = names.iter().zip(SERIES.into_iter().cycle()).map(curve).collect();
    let end = |curve: &Curve| {
        let (triangles, spread) = curve.points.last().copied().unwrap_or((0.0, Spread::once(f64::NAN)));
        format!("{} {:.1}% at {triangles}", curve.name, spread.median)
    };
    let ends = all.iter().map(end).collect::<Vec<_>>().join("; ");
    let caption = Caption {
        name: "greedy-excess".into(),
        title: "Cost of greedy trees over the optimum".into(),
        reading: "Means; whiskers from the least to the 95th percentile.".into(),
        alt: format!("Means at the most triangles: {ends}."),
    };
    let x = Axis { name: "triangles", is_log: false, number: tick };
    curves::curves(caption, &all, &x, &Axis { name: "% above the optimum", is_log: false, number: tick })
}

impl Paged for Greedy {
    const PAGE: Page = GREEDY;
    const TITLE: [&'static str; 2] = [
        "Greedy trees",
        "A builder that goes top-down takes the best split of a node as if both sides were leaves. What does the tree cost over the \
         cheapest one that splits between sorted centroids can make (van Kralingen 2023, chapter 4)?",
    ];

    fn summary(points: &[Greedy]) -> Markup {
        let groups = groups(points);
        let growth = growth(&groups);
        let table = Table::new("Greedy over optimum", groups)
            .name("scenes", Group::name)
            .number("triangles", "", |group| Some(group.triangles.into()), count)
            .number("scenes", "", |group| Some(group.excess.len() as f64), count)
            .number("mean", "% above", |group| Some(group.mean()), percent)
            .number("thesis", "% above", Group::published, percent)
            .number("95th percentile", "% above", |group| Some(group.high()), percent)
            .number("greatest", "% above", |group| group.excess.last().copied(), percent)
            .number("sets searched", "at most", |group| Some(group.sets as f64), count);
        html! {
            @if let Some(growth) = growth { p { (growth) } }
            p {
                "The thesis has about 0.5% at 3 random triangles and about 5% at 15, says that averages go up to 3.5% and single scenes beyond 8%, and finds "
                "no difference over 4 tetrahedra."
            }
            (table.html())
        }
    }

    fn sections(points: &[Greedy]) -> Result<(Vec<Section>, Vec<Chart>)> {
        let charts: Vec<Chart> = chart(&groups(points))?.into_iter().collect();
        if charts.is_empty() {
            return Ok((Vec::new(), charts));
        }
        Ok((vec![Section::new("excess", "Over the number of triangles", document::charts(&charts))], charts))
    }

    fn terms() -> Markup {
        html! {
            dt { "Greedy" }
            dd { "The builder " code { "sweep" } ": of all splits of a node along all axes the best by SAH, leaves where they are cheaper." }
            dt { "Optimum" }
            dd {
                "The cheapest of all trees whose nodes are split between two centroids along an axis, with leaves of any size. A subtree's cost depends on its set of "
                "triangles alone, so each set is searched once."
            }
            dt { "SAH cost" }
            dd { "(3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the root." }
            dt { "The scenes" }
            dd {
                b { "random" } ": corners anywhere in a cube. " b { "displaced" } ": equal triangles, each turned and moved in its cell of a grid. " b { "tetrahedra" }
                ": the same with the faces of tetrahedra. " b { "sampled" } ": triangles of a real scene, drawn by their areas. " b { "near" }
                ": a triangle of a real scene that is drawn, and those nearest to it."
            }
            dt { "95th percentile" }
            dd { "The least excess that no more than one scene in twenty exceeds. Of more than 30 triangles there are fewer scenes, as a search takes many seconds." }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(triangles: u32, seed: u64, ratio: f64) -> Greedy {
        Greedy {
            experiment: Experiment::Greedy,
            kind: GreedyKind::Random,
            scene: None,
            triangles,
            seed,
            greedy: 10.0 * ratio,
            optimum: 10.0,
            sets: seed,
        }
    }

    #[test]
    fn groups_have_means_and_the_least_excess_that_one_in_twenty_exceeds() {
        let points: Vec<Greedy> = (0..40).map(|seed| point(9, seed, 1.0 + 0.01 * seed as f64)).collect();
        let [group] = &groups(&points)[..] else { panic!("one kind and size") };
        assert!((group.mean() - 19.5).abs() < 1e-9 && (group.high() - 37.0).abs() < 1e-9, "{}", group.high());
        assert_eq!((group.sets, group.published()), (39, None));
    }

    #[test]
    fn the_sentence_on_growth_follows_from_the_means() {
        let sentence = |exponent: f64| {
            let points: Vec<Greedy> =
                [16, 24, 40, 64].map(|n| point(n, 1, 1.0 + 0.001 * f64::from(n).powf(exponent))).into();
            growth(&groups(&points)).expect("four sizes")
        };
        assert!(sentence(1.0).contains("grows with the number") && sentence(1.0).contains("a factor of 2.00 at 1000"));
        assert!(sentence(0.5).contains("more slowly") && sentence(0.5).contains("n^0.50"));
        assert!(sentence(1.5).contains("faster than"));
        assert_eq!(growth(&groups(&[point(15, 1, 1.1)])), None);
    }
}
