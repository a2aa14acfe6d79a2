//! What a finished tree costs by each heuristic: the measure of rays that it builds by, over all nodes.

use crate::Result;
use crate::rays::sample;
use crate::scene::Scene;
use crate::subjects::taught::{CameraRays, HeuristicSpec, OcclusionRules, Taught};
use hedgerow::bvh::layout::Bvh2;
use hedgerow_host::bvh::heuristic::InteriorForm;
use std::collections::BTreeMap;

/// The heuristics, as `heuristic=` has them.
pub const NAMES: [&str; 7] = ["interior", "interior-hq", "interior-fast", "perspective", "rdh", "osah", "srdh"];

/// The heuristics with what a scene gives them: its camera, and rays with the seed of those that teach.
pub struct OwnCosts(Vec<(&'static str, Taught)>);

impl OwnCosts {
    /// Of a scene.
    ///
    /// # Errors
    /// It has no triangles.
    pub fn new(scene: &Scene) -> Result<OwnCosts> {
        let kinds = || sample::FRAME.to_vec();
        let of_name = |name| match name {
            "interior" => HeuristicSpec::Interior(InteriorForm::Exact),
            "interior-hq" => HeuristicSpec::Interior(InteriorForm::HighQuality),
            "interior-fast" => HeuristicSpec::Interior(InteriorForm::Fast),
            "perspective" => HeuristicSpec::Camera { rays: CameraRays::Perspective, weight: 1.0 },
            "rdh" => HeuristicSpec::Distribution { kinds: kinds(), most: sample::MOST, weight: 1.0 },
            "srdh" => HeuristicSpec::Shadow { kinds: sample::ANY_HIT.to_vec(), most: sample::MOST, weight: 1.0 },
            _ => HeuristicSpec::Occlusion { kinds: kinds(), weight: 1.0, rules: OcclusionRules::Plain },
        };
        NAMES
            .into_iter()
            .map(|name| Ok((name, of_name(name).taught(Some(scene))?)))
            .collect::<Result<_>>()
            .map(OwnCosts)
    }

    /// What a tree costs by each; one that knows nothing of the scene is left out.
    ///
    /// # Errors
    /// A camera or a ray cannot be used.
    pub fn of(&self, tree: &Bvh2, [c_t, c_i]: [f64; 2]) -> Result<BTreeMap<String, f64>> {
        let cost = |(name, taught): &(&str, Taught)| {
            Ok(taught.heuristic().cost(tree, c_t, c_i)?.map(|cost| ((*name).to_owned(), cost)))
        };
        self.0.iter().filter_map(|own| cost(own).transpose()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LoadOptions, load};
    use crate::subjects::builders::Spec;

    #[test]
    fn a_tree_by_rays_costs_them_less_than_one_by_area() {
        let scene = load("gen:stadium:4", &LoadOptions::default()).expect("a generator");
        let own = OwnCosts::new(&scene).expect("triangles");
        let costs = |spec: &str| {
            let spec: Spec = spec.parse().expect("known");
            let mut subject = spec.make_for(None, &scene).expect("on the host");
            own.of(&subject.tree().expect("built").expect("a BVH"), [3.0, 2.0]).expect("sound rays")
        };
        let (by_area, by_rays) = (costs("binned:axes=all:termination=off"), costs("binned:axes=all:heuristic=rdh"));
        assert_eq!(by_area.keys().map(String::as_str).collect::<Vec<_>>().len(), NAMES.len());
        assert!(by_rays["rdh"] < by_area["rdh"], "{by_rays:?} {by_area:?}");
        let by_shadows = costs("binned:axes=all:heuristic=srdh");
        assert!(by_shadows["srdh"] < by_area["srdh"], "{by_shadows:?} {by_area:?}");
    }
}
