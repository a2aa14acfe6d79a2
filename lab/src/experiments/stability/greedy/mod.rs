//! `stability greedy`: what a greedy full sweep costs over the cheapest tree by sorted planes (van Kralingen 2023, chapter 4).
//!
//! The thesis enumerates trees of up to 15 triangles. [`optimal::of_planes`] finds the same optimum of up to 64, so that the
//! experiment goes on where its growth can be seen, and to parts of real scenes (section 7.6 of the thesis).

pub mod scenes;

use super::points::{Experiment, Greedy, GreedyKind};
use crate::Result;
use crate::measure::Sink;
use crate::scene::Scene;
use hedgerow::bvh::layout::Header;
use hedgerow::bvh::sah::Collapse;
use hedgerow::geometry::Aabb;
use hedgerow_host::bvh::{HostBvhOptions, HostMethod, build_aabbs, optimal};
use rayon::prelude::*;

/// Triangles of random scenes: those of the thesis, and more.
const RANDOM: [u32; 19] = [3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 20, 25, 30, 40, 50, 64];
/// Triangles in cells: 12 is that of the thesis.
const DISPLACED: [u32; 4] = [12, 20, 30, 40];
/// Tetrahedra in cells: 4 is that of the thesis.
const TETRAHEDRA: [u32; 4] = [4, 6, 8, 10];
/// Triangles of parts of real scenes.
const PARTS: [u32; 3] = [15, 30, 64];
/// Scenes of more triangles take so long that there are fewer of them: about as many as take as long as all of this many, as the
/// time grows with the sixth power.
const MANY: u32 = 30;
/// But no fewer than these.
const FEWEST: u32 = 2;

/// What is measured.
pub struct GreedySetup<'a> {
    /// How many random scenes there are of up to 30 triangles. There are half as many of the other kinds, and fewer of more triangles.
    pub seeds: u32,
    /// Scenes of more triangles than this are left out.
    pub most: u32,
    /// The seed of the first scene of each kind.
    pub first_seed: u64,
    /// Is called with what is being done, for a progress bar.
    pub say: &'a dyn Fn(&str),
}

impl GreedySetup<'_> {
    /// The seeds of scenes of a kind.
    fn seeds(&self, kind: GreedyKind, triangles: u32) -> std::ops::Range<u64> {
        let of_kind = if kind == GreedyKind::Random { self.seeds } else { self.seeds.div_ceil(2) };
        let affordable = f64::from(of_kind) * (f64::from(MANY) / f64::from(triangles)).powi(6);
        let count = of_kind.min((affordable as u32).max(FEWEST));
        self.first_seed..self.first_seed + u64::from(count)
    }

    /// Measures all scenes of a kind, each made by its seed.
    fn measure(
        &self,
        (kind, scene): (GreedyKind, Option<&str>),
        triangles: u32,
        make: impl Fn(u64) -> Vec<Aabb> + Sync,
        point: &mut Sink<'_, Greedy>,
    ) -> Result<()> {
        if triangles > self.most {
            return Ok(());
        }
        (self.say)(&format!("{}, {triangles} triangles", scene.unwrap_or(kind.name())));
        let seeds: Vec<u64> = self.seeds(kind, triangles).collect();
        let of_seed = |&seed: &u64| of_boxes(&make(seed), kind, scene, seed);
        let points: Vec<Result<Greedy>> = seeds.par_iter().map(of_seed).collect();
        points.into_iter().try_for_each(|of_scene| point(of_scene?))
    }
}

/// Measures every scene of the thesis and beyond, and parts of `scenes`.
///
/// # Errors
/// Those of `point`.
pub fn measure(setup: &GreedySetup<'_>, scenes: &[Scene], point: &mut Sink<'_, Greedy>) -> Result<()> {
    for triangles in RANDOM {
        setup.measure((GreedyKind::Random, None), triangles, |seed| scenes::random(triangles, seed), point)?;
    }
    for triangles in DISPLACED {
        setup.measure((GreedyKind::Displaced, None), triangles, |seed| scenes::displaced(triangles, seed), point)?;
    }
    for count in TETRAHEDRA {
        setup.measure((GreedyKind::Tetrahedra, None), 4 * count, |seed| scenes::tetrahedra(count, seed), point)?;
    }
    for Scene { name, mesh, .. } in scenes {
        for triangles in PARTS.into_iter().filter(|&triangles| triangles as usize <= mesh.triangles.len()) {
            let sampled = |seed| scenes::sampled(mesh, triangles, seed);
            setup.measure((GreedyKind::Sampled, Some(name)), triangles, sampled, point)?;
            let near = |seed| scenes::near(mesh, triangles, seed);
            setup.measure((GreedyKind::Near, Some(name)), triangles, near, point)?;
        }
    }
    Ok(())
}

fn of_boxes(boxes: &[Aabb], kind: GreedyKind, scene: Option<&str>, seed: u64) -> Result<Greedy> {
    let greedy = build_aabbs(boxes, &HostBvhOptions::of(HostMethod::Sweep))?.tree.header;
    let optimum = optimal::of_planes(boxes, &Collapse::SAH)?;
    Ok(Greedy {
        experiment: Experiment::Greedy,
        kind,
        scene: scene.map(str::to_owned),
        triangles: boxes.len() as u32,
        seed,
        greedy: sah(&greedy),
        optimum: sah(&optimum.tree.header),
        sets: optimum.sets as u64,
    })
}

/// The cost over the area of the root; 0 where that has none.
fn sah(header: &Header) -> f64 {
    if header.built_area > 0.0 { f64::from(header.cost) / f64::from(header.built_area) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LoadOptions;

    fn measured(seeds: u32, most: u32, scenes: &[Scene]) -> Vec<Greedy> {
        let setup = GreedySetup { seeds, most, first_seed: 7, say: &|_| {} };
        let mut points = Vec::new();
        let mut point = |of_scene| {
            points.push(of_scene);
            Ok(())
        };
        measure(&setup, scenes, &mut point).expect("few triangles");
        points
    }

    #[test]
    fn greedy_trees_cost_no_less_than_the_optimum_and_those_over_tetrahedra_next_to_nothing_more() {
        let points = measured(50, 16, &[]);
        assert!(points.iter().all(|point| point.ratio() >= 1.0 - 1e-5), "{points:?}");
        let of = |kind| {
            let ratios: Vec<f64> = points.iter().filter(|p| p.kind == kind).map(Greedy::ratio).collect();
            (ratios.len(), ratios.iter().sum::<f64>() / ratios.len() as f64)
        };
        let [(randoms, _), (displaced, of_displaced), (tetrahedra, of_tetrahedra)] =
            [GreedyKind::Random, GreedyKind::Displaced, GreedyKind::Tetrahedra].map(of);
        assert_eq!((randoms, displaced, tetrahedra), (13 * 50, 25, 25), "as many as the thesis has");
        // The thesis finds no difference for tetrahedra, whose faces belong together.
        assert!(of_tetrahedra < 1.01 && of_tetrahedra < of_displaced, "{of_tetrahedra}, {of_displaced}");
    }

    #[test]
    fn parts_of_a_scene_are_measured_and_named() {
        let scene = crate::scene::load("gen:icosphere:3", &LoadOptions::default()).expect("a generator");
        let points = measured(2, 15, &[scene]);
        let parts: Vec<&Greedy> = points.iter().filter(|point| point.scene.is_some()).collect();
        assert_eq!(parts.iter().map(|p| p.kind).collect::<Vec<_>>(), [GreedyKind::Sampled, GreedyKind::Near]);
        assert!(parts.iter().all(|part| part.triangles == 15 && part.optimum > 0.0), "{parts:?}");
    }
}
