//! Trees on trial: the device decides as the twin does, and both trees are the one that was taken.

use crate::common::device;
use crate::common::shapes::{hard_rays, soup, tree_of};
use hedgerow::bvh::layout::{Bvh2, Triangle, status};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::reinsertion::CostOnHost;
use hedgerow::gpu::Region;
use hedgerow::trace::counts::CountedRays;
use hedgerow::trace::trial::{Trial, TrialResult, TrialTrees};
use hedgerow::trace::twin::trial as host;
use hedgerow::trace::{Query, Ray};

const QUERIES: [Query; 2] = [Query::ClosestHit, Query::AnyHit];

fn on_device(tree: &Bvh2, copy: &Bvh2, rays: &[Ray], stride: u32) -> (TrialResult, Bvh2, Bvh2) {
    let device = device();
    let trial = Trial::new(device, Collapse::SAH, tree.header.primitive_count);
    let [structure, of_copy] = [tree, copy].map(|tree| device.upload("a tree", &tree.to_bytes()).expect("memory"));
    let uploaded = device.upload("rays", rays).expect("memory");
    let result = device.buffer("result", size_of::<TrialResult>() as u64).expect("memory");
    let trees = TrialTrees { structure: structure.region(), copy: of_copy.region(), result: result.region() };
    let rays = CountedRays { rays: uploaded.region(), ray_count: rays.len() as u32, first: 0, stride };
    device
        .run(None, |r| {
            trial.record_begin(r, &trees)?;
            r.barrier();
            QUERIES.iter().try_for_each(|&query| trial.record_rays(r, query, &rays, &trees))?;
            r.barrier();
            trial.record_decision(r, &trees)
        })
        .expect("tried");
    let [structure, copy] = [(&structure, tree), (&of_copy, copy)].map(|(buffer, tree)| {
        Bvh2::<Triangle>::from_bytes(&buffer.read::<u8>(tree.to_bytes().len())).expect("a structure")
    });
    (result.read(1)[0], structure, copy)
}

#[track_caller]
fn tried(what: &str, tree: &Bvh2, copy: &Bvh2, rays: &[Ray], stride: u32) -> TrialResult {
    let work = [tree, copy].map(|tree| {
        let of = |query| host::work(tree, rays.iter().step_by(stride as usize), query, &Collapse::SAH);
        QUERIES.map(of).iter().sum()
    });
    let (mut expected_tree, mut expected_copy) = (tree.clone(), copy.clone());
    let expected = host::decide(&mut expected_tree, &mut expected_copy, work);
    let (got, got_tree, got_copy) = on_device(tree, copy, rays, stride);
    assert_eq!(got, expected, "{what}");
    assert!(got_tree.to_bytes() == expected_tree.to_bytes(), "{what}: another tree");
    assert!(got_copy.to_bytes() == expected_copy.to_bytes(), "{what}: another copy");
    got
}

#[test]
fn a_better_copy_is_taken_and_a_worse_one_is_not() {
    let corners = soup(2_000, 0.1, 5);
    let rays = hard_rays(&corners, 1_003, 1.0, [0.0; 3], 11);
    let tree = tree_of(&corners);
    let better = tree.reinserted_by(&ReinsertionOptions::HIGH, 0, &CostOnHost::Area).expect("a tree");
    let result = tried("better", &tree, &better, &rays, 1);
    assert_eq!(result.is_taken, 1, "{result:?}");
    let result = tried("worse", &better, &tree, &rays, 3);
    assert_eq!(result.is_taken, 0, "{result:?}");
    let result = tried("the same", &tree, &tree, &rays, 1);
    assert_eq!((result.is_taken, result.work[0]), (0, result.work[1]));
    let result = tried("no rays", &tree, &better, &[], 1);
    assert_eq!(result, TrialResult::default());
}

#[test]
fn copies_that_cannot_be_used_are_never_taken() {
    let corners = soup(300, 0.1, 5);
    let rays = hard_rays(&corners, 200, 1.0, [0.0; 3], 11);
    let tree = tree_of(&corners);
    // It takes no work, as no ray is traced in it.
    let mut unusable = tree.reinserted_by(&ReinsertionOptions::FAST, 0, &CostOnHost::Area).expect("a tree");
    unusable.header.status |= status::TOO_DEEP;
    let result = tried("too deep", &tree, &unusable, &rays, 1);
    assert_eq!((result.is_taken, result.work[1]), (0, 0));
    let of_something_else = tree_of(&corners[..299].to_vec());
    assert_eq!(tried("another scene", &tree, &of_something_else, &rays, 1).is_taken, 0);
}

#[test]
fn one_percent_is_not_enough() {
    let tree = tree_of(&soup(10, 0.1, 5));
    let decided = |work| host::decide(&mut tree.clone(), &mut tree.clone(), work).is_taken;
    assert_eq!([decided([1000, 990]), decided([1000, 989]), decided([u64::MAX, u64::MAX / 2])], [0, 1, 1]);
}

#[test]
fn what_is_no_trial_is_refused_by_name() {
    let device = device();
    let trial = Trial::new(device, Collapse::SAH, 100);
    let of = |bytes| Region { address: 16, bytes };
    let trees = TrialTrees { structure: of(1 << 20), copy: of(1 << 20), result: of(24) };
    let rays = CountedRays { rays: of(320), ray_count: 10, first: 0, stride: 1 };
    let refused = |rays: CountedRays, trees: TrialTrees| {
        device.run(None, |r| trial.record_rays(r, Query::ClosestHit, &rays, &trees)).expect_err("refused").to_string()
    };
    assert!(refused(CountedRays { stride: 0, ..rays }, trees).contains("take a stride of 1"));
    assert!(refused(CountedRays { ray_count: 11, ..rays }, trees).contains("memory of rays of 320"));
    assert!(refused(rays, TrialTrees { result: of(23), ..trees }).contains("result of a trial"));
    assert!(refused(rays, TrialTrees { copy: of(1000), ..trees }).contains("the copy of the BVH on trial"));
}
