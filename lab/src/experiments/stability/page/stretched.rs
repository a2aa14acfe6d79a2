//! What the pages of far and of huge triangles have in common: charts over e, scene by scene, and where each builder loses a tenth.

use super::Paged;
use super::losses::{Loss, cost_chart, kinds, short_codes, speed_chart};
use crate::Result;
use crate::experiments::stability::points::{Experiment, Stretched};
use crate::experiments::stability::relative::Stretch;
use crate::report::beside::Page;
use crate::report::{Chart, Mark, Section, Table, distinct, document, lines, slug};
use maud::{Markup, html};

/// What stretches a scene, and what its page says of it.
pub trait StretchPage: Stretch {
    /// See [`Paged::PAGE`].
    const PAGE: Page;
    /// The command that writes the points.
    const COMMAND: &'static str;
    /// See [`Paged::TITLE`].
    const TITLE: [&'static str; 2];
    /// How to read the table.
    fn reading(points: &[Stretched<Self>]) -> Markup;
    /// How it is measured: terms and what they mean.
    fn terms() -> Markup;
    /// Its part of the names of charts.
    fn slug(&self) -> String;
    /// Adds the columns that say what stretches.
    fn own_columns<'p>(table: Losses<'p, Self>) -> Losses<'p, Self>;
    /// Adds the columns behind that of the cost.
    fn more_columns<'p>(table: Losses<'p, Self>, points: &[Stretched<Self>]) -> Losses<'p, Self>;
    /// What is expected of builders in a chart of costs.
    fn marks(_points: &[&Stretched<Self>], _builders: &[&str]) -> Vec<Mark> {
        Vec::new()
    }
}

/// Where each builder loses a tenth.
pub type Losses<'p, S> = Table<'p, Row<'p, S>>;

/// A builder on a scene that is stretched in one way.
pub struct Row<'p, S> {
    /// The builder.
    pub builder: &'p str,
    /// Its points.
    pub own: Vec<&'p Stretched<S>>,
    /// Those of all builders.
    pub all: Vec<&'p Stretched<S>>,
}

impl<'p, S: StretchPage> Row<'p, S> {
    /// Its point of the greatest e.
    pub fn last(&self) -> &'p Stretched<S> {
        self.own.iter().max_by_key(|point| point.e).expect("a row has points")
    }
}

impl<S: StretchPage> lines::Entry for Stretched<S> {
    const FILE: &'static str = S::PAGE.records;
    const COMMAND: &'static str = S::COMMAND;

    fn fault(&self) -> Option<String> {
        other_experiment(self.experiment, S::EXPERIMENT)
    }
}

/// What is wrong with a point of another experiment.
pub(super) fn other_experiment(found: Experiment, own: Experiment) -> Option<String> {
    (found != own).then(|| format!("experiment {:?}", format!("{found:?}").to_lowercase()))
}

impl<S: StretchPage> Paged for Stretched<S> {
    const PAGE: Page = S::PAGE;
    const TITLE: [&'static str; 2] = S::TITLE;

    fn summary(points: &[Self]) -> Markup {
        html! {
            p {
                "The first e at which the scene costs a tenth more than at e = 0, or its rays have lost a tenth of their speed at two points in a row; later is better. "
                (S::reading(points))
            }
            (losses(points))
        }
    }

    fn sections(points: &[Self]) -> Result<(Vec<Section>, Vec<Chart>)> {
        let builders = distinct(points.iter().map(|point| point.builder.as_str()));
        let (mut sections, mut all) = (Vec::new(), Vec::new());
        for scene in distinct(points.iter().map(|point| point.scene.as_str())) {
            let (mut charts, mut more) = (Vec::new(), Vec::new());
            let of_scene: Vec<&Self> = points.iter().filter(|point| point.scene == scene).collect();
            for by in distinct(of_scene.iter().map(|point| point.by)) {
                let own: Vec<&Self> = of_scene.iter().copied().filter(|point| point.by == by).collect();
                let name = format!("{}-{}", slug(scene), by.slug());
                let titled = [&format!("{}-{name}", S::PAGE.stem()), &format!("{scene}, {by}")];
                charts.extend(cost_chart(&own, &builders, &S::marks(&own, &builders), titled)?);
                charts.extend(speed_chart(&own, &builders, None, titled)?);
                for kind in kinds(points) {
                    more.extend(speed_chart(&own, &builders, Some(kind), titled)?);
                }
            }
            let body = html! {
                (document::charts(&charts))
                @if !more.is_empty() { details { summary { "Every kind of ray" } (document::charts(&more)) } }
            };
            sections.push(Section::new(format!("scene-{}", slug(scene)), scene, body));
            all.extend(charts.into_iter().chain(more));
        }
        Ok((sections, all))
    }

    fn terms() -> Markup {
        S::terms()
    }
}

fn losses<S: StretchPage>(points: &[Stretched<S>]) -> Markup {
    let mut rows: Vec<Row<'_, S>> = Vec::new();
    for scene in distinct(points.iter().map(|point| point.scene.as_str())) {
        for by in distinct(points.iter().map(|point| point.by)) {
            let all: Vec<_> = points.iter().filter(|point| point.scene == scene && point.by == by).collect();
            for builder in distinct(all.iter().map(|point| point.builder.as_str())) {
                let own = all.iter().copied().filter(|point| point.builder == builder).collect();
                rows.push(Row { builder, own, all: all.clone() });
            }
        }
    }
    let table = Table::new("Where each loses a tenth", rows).id("losses").name("scene", |row| &row.own[0].scene);
    let table = table.cell("builder", |row| {
        html! { td.builder data-value=(row.builder) title=(row.builder) { (short_codes(row.builder)) } }
    });
    let table = S::own_columns(table).figure("cost", "e", |row| Loss::of_cost(&row.own).cell());
    let table = kinds(points).into_iter().fold(S::more_columns(table, points), |table, kind| {
        table.figure(kind, "e", move |row| Loss::of_speed(&row.own, kind).cell())
    });
    table.html()
}
