//! `growth-top.html`: what far instances cost a top level.

use super::Paged;
use super::stretched::other_experiment;
use crate::Result;
use crate::experiments::stability::points::Experiment;
use crate::experiments::stability::top::points::{FarInstances, GOALS, TopBuilder, TopGrowth};
use crate::measure::Spread;
use crate::report::beside::{GROWTH_TOP, Page};
use crate::report::elements::number;
use crate::report::numbers::{count, three_digits, tick};
use crate::report::{Axis, Caption, Chart, Curve, SERIES, Section, Table, curves, distinct, document, lines, slug};
use maud::{Markup, html};

impl lines::Entry for TopGrowth {
    const FILE: &'static str = GROWTH_TOP.records;
    const COMMAND: &'static str = "hedgerow stability growth --level top";

    fn fault(&self) -> Option<String> {
        other_experiment(self.experiment, Experiment::GrowthTop)
    }
}

/// A builder on a scene with what is far in one manner: the worst of all e.
pub struct TopRow<'p> {
    /// The scene.
    pub scene: &'p str,
    /// The builder.
    pub builder: TopBuilder,
    /// What is far.
    pub by: FarInstances,
    /// Its points.
    own: Vec<&'p TopGrowth>,
}

/// A figure and the e that has it.
pub type Worst = Option<(f64, u32)>;

impl TopRow<'_> {
    fn worst(&self, of: impl Fn(&TopGrowth) -> Option<f64>, is_worse: impl Fn(f64, f64) -> bool) -> Worst {
        let all = self.own.iter().filter_map(|point| Some((of(point)?, point.e)));
        all.reduce(|worst, next| if is_worse(next.0, worst.0) { next } else { worst })
    }

    /// The greatest relative cost.
    pub fn cost(&self) -> Worst {
        self.worst(|point| point.relative_cost, |a, b| a > b)
    }

    /// The most relative work, of the geometric mean over kinds of rays.
    pub fn work(&self) -> Worst {
        self.worst(TopGrowth::relative_work, |a, b| a > b)
    }

    /// The least relative speed, of the geometric mean over kinds of rays.
    pub fn speed(&self) -> Worst {
        self.worst(TopGrowth::speed, |a, b| a < b)
    }

    /// The longest relative build.
    pub fn build(&self) -> Worst {
        self.worst(|point| Some(point.relative_build.median), |a, b| a > b)
    }

    /// The longest relative frame.
    pub fn frame(&self) -> Worst {
        self.worst(|point| point.relative_frame, |a, b| a > b)
    }

    /// The most bits that codes have.
    pub fn code_bits(&self) -> u32 {
        self.own.iter().map(|point| point.code_bits).max().unwrap_or(0)
    }
}

/// Every builder, scene and manner of being far.
pub fn rows(points: &[TopGrowth]) -> Vec<TopRow<'_>> {
    let keys = distinct(points.iter().map(|point| (point.scene.as_str(), point.by, point.builder)));
    let row = |(scene, by, builder)| {
        let is_own = |point: &&TopGrowth| (point.scene.as_str(), point.by, point.builder) == (scene, by, builder);
        TopRow { scene, builder, by, own: points.iter().filter(is_own).collect() }
    };
    keys.into_iter().map(row).collect()
}

/// A figure, the e that has it, and whether it keeps the goal.
fn cell(worst: Worst, keeps: impl Fn(f64) -> bool) -> Markup {
    let Some((value, e)) = worst else { return number(None, three_digits) };
    html! { td.number .wrong[!keeps(value)] data-value=(value) { (three_digits(value)) small { "e = " (e) } } }
}

fn table(points: &[TopGrowth]) -> Markup {
    let [cost, speed, build] = GOALS;
    Table::new("The worst of all e", rows(points))
        .id("worst")
        .name("scene", |row| row.scene)
        .text("top level", |row| row.builder)
        .number("far", "", |row| Some(row.by.far.into()), count)
        .number("axes", "", |row| Some(row.by.axes.into()), tick)
        .text("side", |row| row.by.sides)
        .number("code", "bits", |row| Some(row.code_bits().into()), count)
        .figure("cost", "×", move |row| cell(row.cost(), |value| value <= cost))
        .figure("work", "×", |row| cell(row.work(), |_| true))
        .figure("speed", "×", move |row| cell(row.speed(), |value| value >= speed))
        .figure("build", "×", move |row| cell(row.build(), |value| value <= build))
        .figure("frame", "×", |row| cell(row.frame(), |_| true))
        .html()
}

/// What is drawn over e.
struct Drawn {
    slug: &'static str,
    title: &'static str,
    axis: &'static str,
    of: fn(&TopGrowth) -> Option<f64>,
}

const DRAWN: [Drawn; 3] = [
    Drawn { slug: "cost", title: "cost of what stays", axis: "relative cost", of: |point| point.relative_cost },
    Drawn { slug: "speed", title: "speed of all kinds of rays", axis: "relative speed", of: TopGrowth::speed },
    Drawn { slug: "frame", title: "build and trace", axis: "relative time", of: |point| point.relative_frame },
];

fn chart(points: &[&TopGrowth], drawn: &Drawn, name: &str, title: &str) -> Result<Option<Chart>> {
    let builders = distinct(points.iter().map(|point| point.builder));
    let curve = |(builder, tone): (&TopBuilder, _)| {
        let own = points.iter().filter(|point| point.builder == *builder);
        let points = own.filter_map(|point| Some((f64::from(point.e), Spread::once((drawn.of)(point)?)))).collect();
        Curve { name: builder.to_string(), tone, points, law: None }
    };
    let all: Vec<Curve> = builders.iter().zip(SERIES.into_iter().cycle()).map(curve).collect();
    let all: Vec<Curve> = all.into_iter().filter(|curve| !curve.points.is_empty()).collect();
    let end = |curve: &Curve| {
        let (e, spread) = curve.points.last().copied().unwrap_or((0.0, Spread::once(f64::NAN)));
        format!("{} {} at e = {e}", curve.name, three_digits(spread.median))
    };
    let ends = all.iter().map(end).collect::<Vec<_>>().join("; ");
    let caption = Caption {
        name: format!("{name}-{}", drawn.slug),
        title: format!("{title}: {}", drawn.title),
        reading: format!("Over that at e = 0; logarithmic. {ends}."),
        alt: ends,
    };
    let x = Axis { name: "e: 2^e times as long", is_log: false, number: tick };
    curves::curves(caption, &all, &x, &Axis { name: drawn.axis, is_log: true, number: tick })
}

impl Paged for TopGrowth {
    const PAGE: Page = GROWTH_TOP;
    const TITLE: [&'static str; 2] = [
        "Growing bounds of top levels",
        "Instances 2^e extents away make the bounds of a top level grow, in one axis or in three. What do they cost what stays: the tree, \
         its rays, its build?",
    ];

    fn summary(points: &[TopGrowth]) -> Markup {
        let [cost, speed, build] = GOALS;
        html! {
            p {
                "The worst figure of all e, over that of e = 0, and the e that has it. The goals: a cost of at most " (cost) ", at least " (speed)
                " of the speed, a build of at most " (build) "; what misses them is marked."
            }
            (table(points))
        }
    }

    fn sections(points: &[TopGrowth]) -> Result<(Vec<Section>, Vec<Chart>)> {
        let (mut sections, mut all) = (Vec::new(), Vec::new());
        for scene in distinct(points.iter().map(|point| point.scene.as_str())) {
            let of_scene: Vec<&TopGrowth> = points.iter().filter(|point| point.scene == scene).collect();
            let mut charts = Vec::new();
            for by in distinct(of_scene.iter().map(|point| point.by)) {
                let own: Vec<&TopGrowth> = of_scene.iter().copied().filter(|point| point.by == by).collect();
                let name = format!("{}-{}-{}", GROWTH_TOP.stem(), slug(scene), slug(&by.to_string()));
                for drawn in &DRAWN {
                    charts.extend(chart(&own, drawn, &name, &format!("{scene}, {by}"))?);
                }
            }
            sections.push(Section::new(format!("scene-{}", slug(scene)), scene, document::charts(&charts)));
            all.extend(charts);
        }
        Ok((sections, all))
    }

    fn terms() -> Markup {
        html! {
            dt { "Far instances" }
            dd {
                "Cubes of twelve triangles, each in the box of the far triangle of " code { "hedgerow stability growth" } ": for bounds from lo to hi from "
                "lo + (hi − lo) · 2^e · (1 − 10⁻⁶) to lo + (hi − lo) · 2^e in the axes that grow, and the last thousandth of the others; mirrored on the "
                "negative side. Sides that are drawn are the same at every e."
            }
            dt { "Cost" }
            dd {
                "(3 · Σ area of inner nodes + 2 · Σ area of entries) / area of what stays, every box of the top level clipped to that; over the same at "
                "e = 0. An opened instance has several entries. Where rays begin at the node over what is near unless they meet something far, each "
                "takes a step there, and one at the root as many as meet what is far: Σ area of its boxes."
            }
            dt { "Work" }
            dd { "Nodes of both levels, instances and triangles that a ray meets in the mean, over those at e = 0; geometric mean over the kinds of rays." }
            dt { "Speed" }
            dd {
                "Rays of the scene without what is far, by queries of a shader, through both top levels in turn after a warm-up that does not "
                "count; the median of the ratios run by run, geometric mean over the kinds of rays. Each ray must hit what the host's tracer hits."
            }
            dt { "Build, frame" }
            dd { "The device's time of a build of the top level, in turn with one at e = 0; with a trace of every kind of ray it is a frame." }
        }
    }
}
