//! What a tree took for a kind of rays, with its static figures; and the same beside the reference of its scene, as logarithms of
//! ratios: a doubling and a halving are as far from 0 as each other, and scenes of any size lie on each other.

use super::own;
use super::published::ALL_RAYS;
use super::record::TreeRecord;
use crate::subjects::retraced::TreeTracer;

/// How many figures there are.
pub const FIGURES: usize = 5 + own::NAMES.len();
/// SAH cost.
pub const SAH: usize = 0;
/// End-point overlap.
pub const EPO: usize = 1;
/// Leaf count variability.
pub const LCV: usize = 2;
/// Steps a ray.
pub const STEPS: usize = 3;
/// Tests a ray.
pub const TESTS: usize = 4;
/// The first of the heuristics' own costs, in the order of their names.
pub const OWN: usize = 5;

/// How much of each figure is taken; what they sum up to is a prediction.
pub type Weights = [f64; FIGURES];

/// A tree with a kind of rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// The scene.
    pub scene: String,
    /// The builder.
    pub builder: String,
    /// The kind of rays, or [`ALL_RAYS`].
    pub kind: String,
    /// Who traced them.
    pub tracer: TreeTracer,
    /// Nanoseconds a ray.
    pub ns: f64,
    /// What is known of the tree: in the order of the constants here.
    pub figures: [Option<f64>; FIGURES],
    /// Whether the others of its scene are held against it.
    pub is_reference: bool,
}

impl Sample {
    /// What the weighted figures sum up to; `None` where one of those that count is missing.
    pub fn sum(&self, weights: &Weights) -> Option<f64> {
        let term =
            |(weight, figure): (&f64, &Option<f64>)| if *weight == 0.0 { Some(0.0) } else { Some(weight * (*figure)?) };
        weights.iter().zip(&self.figures).map(term).sum()
    }
}

/// All trees with all kinds of rays, by both tracers, each kind by itself and all together.
pub fn samples(records: &[TreeRecord]) -> Vec<Sample> {
    let mut all = Vec::new();
    for record in records {
        for tracer in TreeTracer::ALL {
            for rays in record.rays(tracer).iter().chain(&record.all_rays(tracer)) {
                let mut figures = [None; FIGURES];
                figures[..OWN].copy_from_slice(&[
                    Some(record.sah),
                    record.epo,
                    record.lcv,
                    Some(rays.steps),
                    Some(rays.tests),
                ]);
                for (figure, name) in figures[OWN..].iter_mut().zip(own::NAMES) {
                    *figure = record.own.get(name).copied();
                }
                all.push(Sample {
                    scene: record.scene.clone(),
                    builder: record.builder.clone(),
                    kind: rays.rays.clone(),
                    tracer,
                    ns: rays.ns.median,
                    figures,
                    is_reference: record.is_reference(),
                });
            }
        }
    }
    all
}

/// A tree beside the reference of its scene, with the same rays by the same tracer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point<'s> {
    /// The tree.
    pub tree: &'s Sample,
    /// The reference.
    pub reference: &'s Sample,
}

impl Point<'_> {
    /// log(time / reference's).
    pub fn time(&self) -> Option<f64> {
        log_ratio(self.tree.ns, self.reference.ns)
    }

    /// log(prediction / reference's); `None` where one is missing or 0.
    pub fn prediction(&self, weights: &Weights) -> Option<f64> {
        log_ratio(self.tree.sum(weights)?, self.reference.sum(weights)?)
    }
}

fn log_ratio(value: f64, reference: f64) -> Option<f64> {
    Some((value / reference).ln()).filter(|log| log.is_finite() && value > 0.0)
}

/// Which points are taken together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scope<'a> {
    /// Who traced.
    pub tracer: TreeTracer,
    /// The kind of rays.
    pub kind: &'a str,
    /// The scene; `None` takes all of them, without the references: those lie at 0, one a scene, whatever the figures say.
    pub scene: Option<&'a str>,
}

impl Scope<'_> {
    /// All kinds of rays together, on all scenes.
    pub fn pooled(tracer: TreeTracer) -> Scope<'static> {
        Scope { tracer, kind: ALL_RAYS, scene: None }
    }

    /// Its points. A scene whose reference failed has none.
    pub fn points<'s>(&self, samples: &'s [Sample]) -> Vec<Point<'s>> {
        let alike = |sample: &&Sample| sample.tracer == self.tracer && sample.kind == self.kind;
        let point = |tree: &'s Sample| {
            let is_reference = |sample: &&Sample| sample.is_reference && sample.scene == tree.scene;
            Some(Point { tree, reference: samples.iter().filter(alike).find(is_reference)? })
        };
        let is_in = |sample: &&Sample| self.scene.map_or(!sample.is_reference, |scene| sample.scene == scene);
        samples.iter().filter(alike).filter(is_in).filter_map(point).collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A tree on a scene whose first figures are these.
    pub fn sample(scene: &str, builder: &str, ns: f64, figures: &[f64]) -> Sample {
        let mut all = [None; FIGURES];
        all.iter_mut().zip(figures).for_each(|(place, figure)| *place = Some(*figure));
        Sample {
            scene: scene.into(),
            builder: builder.into(),
            kind: ALL_RAYS.into(),
            tracer: TreeTracer::Host,
            ns,
            figures: all,
            is_reference: builder == "reference",
        }
    }

    #[test]
    fn points_are_ratios_to_the_reference_of_their_scene() {
        let all = [
            sample("a", "reference", 10.0, &[100.0, 0.0]),
            sample("a", "x", 20.0, &[50.0, 3.0]),
            sample("b", "x", 7.0, &[1.0]),
        ];
        let points = Scope::pooled(TreeTracer::Host).points(&all);
        assert_eq!(points.len(), 1, "b has no reference, and a's own is left out");
        let mut sah = [0.0; FIGURES];
        sah[SAH] = 1.0;
        assert_eq!((points[0].time(), points[0].prediction(&sah)), (Some(2f64.ln()), Some(0.5f64.ln())));
        let mut epo = [0.0; FIGURES];
        epo[EPO] = 1.0;
        assert_eq!(points[0].prediction(&epo), None, "the reference has no overlap");
        let mut lcv = [0.0; FIGURES];
        lcv[LCV] = 1.0;
        assert_eq!(points[0].prediction(&lcv), None, "it was not measured");
        let of_a = Scope { scene: Some("a"), ..Scope::pooled(TreeTracer::Host) };
        assert_eq!(of_a.points(&all).len(), 2, "on a scene the reference is a point");
        assert!(Scope::pooled(TreeTracer::Device).points(&all).is_empty());
    }
}
