//! The flux of rays, what it teaches reinsertion, and trees on trial.

use super::builders::meshes;
use crate::device::Device;
use crate::experiments::check::cases::{Cases, Found, same, same_all};
use crate::experiments::check::shapes::{hard_rays, soup};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::flux::{FluxGrid, GRID_BYTES};
use hedgerow::bvh::layout::{Bvh2, Triangle};
use hedgerow::bvh::reinsertion::{Cost, Probed, Reinsertion, ReinsertionOptions};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::bvh::twin::reinsertion::CostOnHost;
use hedgerow::trace::counts::CountedRays;
use hedgerow::trace::flux::{FluxPass, FluxRays};
use hedgerow::trace::trial::{Trial, TrialResult, TrialTrees};
use hedgerow::trace::twin::{flux, tracer, trial};
use hedgerow::trace::{Hit, Query, Ray};

const ROUNDS: ReinsertionOptions = ReinsertionOptions { rounds: 6, stride: 2 };

pub fn by_rays(cases: &mut Cases<'_>) {
    let rays = hard_rays(&soup(300, 0.3, 5), 600, 1.0, [0.0; 3], 11);
    for (name, positions, triangles) in meshes(cases) {
        let tree = lbvh::build(&positions, &triangles, Code::Emc64Var.full(), Collapse::SAH);
        let hits: Vec<Hit> = rays.iter().map(|ray| tracer::closest_hit(&tree, ray)).collect();
        let grid = flux::fill(&tree, rays.iter().zip(&hits));
        let optimised = tree.reinserted_by(&ROUNDS, 1, &CostOnHost::Rays { grid: &grid, share: Cost::SHARE });
        let optimised = optimised.expect("a share in range");
        cases.case(format!("{name}, grid"), |device| grid_as_on_host(device, &tree, (&rays, &hits), &grid));
        cases.case(format!("{name}, rounds and probe"), |device| rounds_as_on_host(device, &tree, &grid, &optimised));
        cases.case(format!("{name}, trial"), |device| trial_as_on_host(device, &tree, &optimised, &rays));
    }
}

fn grid_as_on_host(device: &Device, tree: &Bvh2, (rays, hits): (&[Ray], &[Hit]), expected: &FluxGrid) -> Found {
    let structure = device.upload("structure", &tree.to_bytes())?;
    let (of_rays, of_hits) = (device.upload("rays", rays)?, device.upload("hits", hits)?);
    let grid = device.buffer("grid", GRID_BYTES)?;
    let (rays, hits, ray_count) = (of_rays.region(), of_hits.region(), rays.len() as u32);
    let all = FluxRays { rays, hits, ray_count, first: 0, stride: 1 };
    device.run(None, |r| FluxPass::new(device).record(r, structure.region(), &[all], grid.region()))?;
    same_all("byte", &grid.read::<u8>(GRID_BYTES as usize), &expected.to_bytes())
}

fn rounds_as_on_host(device: &Device, tree: &Bvh2, grid: &FluxGrid, expected: &Bvh2) -> Found {
    let count = tree.header.primitive_count;
    let pass = Reinsertion::new(device, &ROUNDS, count).from_round(1);
    let probe = Reinsertion::new(device, &ReinsertionOptions::PROBE, count);
    let bytes = tree.to_bytes();
    let structure = device.upload("structure", &bytes)?;
    let of_grid = device.upload("grid", &grid.to_bytes())?;
    let found = device.buffer("found", size_of::<Probed>() as u64)?;
    let scratch = device.buffer("scratch", pass.scratch_bytes_by_rays().max(probe.scratch_bytes_by_rays()))?;
    let cost = Cost::Rays { grid: of_grid.region(), share: Cost::SHARE };
    device.run(None, |recorder| {
        probe.record_probe(recorder, structure.region(), &cost, scratch.region(), found.region())?;
        recorder.barrier();
        pass.record_rounds(recorder, structure.region(), &cost, scratch.region())
    })?;
    let on_host = tree.probed(&ReinsertionOptions::PROBE, &CostOnHost::Rays { grid, share: Cost::SHARE })?;
    same("what a probe finds", &found.read::<Probed>(1)[0], &on_host)?;
    let got = Bvh2::<Triangle>::from_bytes(&structure.read::<u8>(bytes.len()))?;
    same("header", &got.header, &expected.header)?;
    same_all("node", &got.nodes, &expected.nodes)
}

fn trial_as_on_host(device: &Device, tree: &Bvh2, copy: &Bvh2, rays: &[Ray]) -> Found {
    let pass = Trial::new(device, Collapse::SAH, tree.header.primitive_count);
    let bytes = tree.to_bytes();
    let (structure, of_copy) = (device.upload("structure", &bytes)?, device.upload("copy", &copy.to_bytes())?);
    let uploaded = device.upload("rays", rays)?;
    let result = device.buffer("result", size_of::<TrialResult>() as u64)?;
    let trees = TrialTrees { structure: structure.region(), copy: of_copy.region(), result: result.region() };
    let counted = CountedRays { rays: uploaded.region(), ray_count: rays.len() as u32, first: 0, stride: 1 };
    device.run(None, |recorder| {
        pass.record_begin(recorder, &trees)?;
        recorder.barrier();
        pass.record_rays(recorder, Query::AnyHit, &counted, &trees)?;
        recorder.barrier();
        pass.record_decision(recorder, &trees)
    })?;
    let work = [tree, copy].map(|tree| trial::work(tree, rays, Query::AnyHit, &Collapse::SAH));
    let (mut expected_tree, mut expected_copy) = (tree.clone(), copy.clone());
    let expected = trial::decide(&mut expected_tree, &mut expected_copy, work);
    same("result", &result.read::<TrialResult>(1)[0], &expected)?;
    same_all("byte of the tree", &structure.read::<u8>(bytes.len()), &expected_tree.to_bytes())?;
    same_all("byte of the copy", &of_copy.read::<u8>(bytes.len()), &expected_copy.to_bytes())
}
