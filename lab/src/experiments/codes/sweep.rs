//! The speed of rays through trees by binning, over the weight λ of its stretch factor (Riemersma 2024, section 4.2 and tables 8 to
//! 11): each beside the tree of the base, in turn.

use super::points::{CodesEntry, Swept, SweptRays};
use super::{BASE, COSTS, CodesSetup, WARM_UPS, least_of_a_run, percent};
use crate::measure::agreement::wrong_where_different;
use crate::measure::{Failure, Sink, Spread, in_turn, mean_work, ratios};
use crate::rays::kinds::{self, RayKind};
use crate::scene::Scene;
use crate::subjects::Subject;
use crate::subjects::builders::Spec;
use crate::{Error, Result};
use hedgerow::bvh::codes::{Binning, Code, Codes};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::{lbvh, quality};
use hedgerow::trace::twin::tracer as host;
use hedgerow::trace::{Query, Ray};
use rayon::prelude::*;

/// Rays that differ between two trees of which brute force looks at, at most.
const DIFFERENCES: usize = 16;

/// Binning by every weight of the stretch factor that the thesis' tables have, 1/λ from 1 on.
pub fn codes() -> impl Iterator<Item = (u32, Codes)> {
    let balanced = Binning::Q4_A4;
    let powers = (0..).map(|k| 1 << k).take_while(|&stretch| stretch <= Binning::STRETCH_MAX);
    powers.map(move |stretch| {
        let binning = Binning::new(balanced.depth(), balanced.count_bits(), stretch);
        (stretch, Code::Bin(binning.expect("a power of two that it takes")).full())
    })
}

/// A tree and what is known of it.
struct Tree<'a> {
    subject: Box<dyn Subject + 'a>,
    sah: Option<f64>,
}

impl<'a> Tree<'a> {
    fn new(stage: &CodesSetup<'a>, spec: &Spec, scene: &'a Scene) -> Result<Tree<'a>> {
        let mut subject = spec.make_for(stage.device, scene)?;
        subject.build()?;
        subject.validate()?;
        let [c_t, c_i] = COSTS;
        let sah = subject.tree()?.map(|tree| quality::of(&tree, c_t, c_i).sah);
        Ok(Tree { subject, sah })
    }
}

/// Measures a scene with every weight. A weight that fails, or whose rays hit something else than they should, is told as an entry, and
/// the rest goes on.
///
/// # Errors
/// The scene has no triangles; the base cannot be built; those of `point`.
pub fn measure(stage: &CodesSetup<'_>, scene: &Scene, point: &mut Sink<'_, CodesEntry>) -> Result<()> {
    let mesh = &scene.mesh;
    let truth = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH);
    let mut hits = |rays: &[Ray]| Ok(rays.par_iter().map(|ray| host::closest_hit(&truth, ray)).collect());
    let mut rays: Vec<(RayKind, Vec<Ray>)> = Vec::new();
    for &kind in stage.kinds {
        let of_kind = kinds::generate(kind, scene, &stage.rays, &mut hits)?;
        // Where nothing is hit there is nothing to follow.
        if !of_kind.is_empty() {
            rays.push((kind, of_kind));
        }
    }
    let base_spec = stage.with(BASE)?;
    let mut base = Tree::new(stage, &base_spec, scene)?;
    for (stretch, codes) in codes() {
        let spec = stage.with(codes)?;
        let of = format!("{}, {spec}", scene.name);
        (stage.say)(&of);
        let measured = Tree::new(stage, &spec, scene).and_then(|mut tree| {
            let of_rays =
                |(kind, rays): &(RayKind, Vec<Ray>)| beside(stage, &mut base, &mut tree, *kind, (rays, &truth));
            let rays = rays.iter().map(of_rays).collect::<Result<_>>()?;
            Ok(Swept {
                scene: scene.name.clone(),
                triangles: mesh.triangles.len() as u64,
                builder: spec.to_string(),
                base: base_spec.to_string(),
                stretch,
                relative_sah: tree.sah.zip(base.sah).map(|(sah, base)| sah / base).filter(|ratio| ratio.is_finite()),
                rays,
            })
        });
        point(match measured {
            Ok(swept) => CodesEntry::Sweep(swept),
            Err(error) => CodesEntry::Failure(Failure::named(of, error)),
        })?;
    }
    Ok(())
}

/// Rays of a kind through both trees in turn, and whether they hit the same.
fn beside(
    stage: &CodesSetup<'_>,
    base: &mut Tree<'_>,
    other: &mut Tree<'_>,
    kind: RayKind,
    (rays, truth): (&[Ray], &Bvh2),
) -> Result<SweptRays> {
    let query = kind.query();
    let mut subjects: [&mut dyn Subject; 2] = [base.subject.as_mut(), other.subject.as_mut()];
    for subject in &mut subjects {
        subject.set_rays(rays)?;
    }
    let times = in_turn(&mut subjects, WARM_UPS, stage.runs, |subject| least_of_a_run(|| subject.trace(query)));
    let times: Vec<Vec<f64>> = times.into_iter().collect::<Result<_>>()?;
    let (expected, found) = (base.subject.hits()?, other.subject.hits()?);
    let wrong = wrong_where_different(truth, rays, query, (&found, &expected), DIFFERENCES);
    if wrong > 0 {
        return Err(Error::Malformed(format!(
            "{wrong} {kind} rays differ from the base's and are wrong by brute force"
        )));
    }
    let expected = work_of(base.subject.as_mut(), query)?;
    let relative_work = work_of(other.subject.as_mut(), query)?.zip(expected).map(|(work, base)| work / base);
    // Speed over the base's is time of the base over time.
    let changes: Vec<f64> = ratios(&times[0], &times[1]).into_iter().map(percent).collect();
    Ok(SweptRays {
        rays: kind.name().into(),
        count: rays.len() as u64,
        base_ms: Spread::of_some(&times[0])?,
        ms: Spread::of_some(&times[1])?,
        change_percent: Spread::of_some(&changes)?,
        relative_work: relative_work.filter(|ratio| ratio.is_finite()),
    })
}

/// What a ray costs in the mean by its steps and tests, where the tracer counts them.
fn work_of(subject: &mut dyn Subject, query: Query) -> Result<Option<f64>> {
    let [c_t, c_i] = COSTS;
    let of =
        |work: Vec<_>| Some(c_t * mean_work(&work, |work| work.steps)? + c_i * mean_work(&work, |work| work.tests)?);
    Ok(subject.work(query)?.and_then(of))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_those_of_the_thesis() {
        let names: Vec<String> = codes().map(|(_, codes)| codes.to_string()).collect();
        assert_eq!(names.len(), 12);
        assert_eq!([&*names[0], &*names[3], &*names[11]], ["bin4a4~1", "bin4a4", "bin4a4~2048"]);
        assert_eq!(codes().last().map(|(stretch, _)| stretch), Some(2048));
    }
}
