//! A build from its primitives to the tree, phase by phase.

use super::bounds::{Bounds, Item};
use super::heuristic::occlusion_complete::{Complete, Planes};
use super::heuristic::split_cost::{Area, ByRays, SplitCost};
use super::heuristic::{Heuristic, Prepared};
use super::input::Input;
use super::top_down::LeafRule;
use super::topology::Topology;
use super::{ALONE, Built, HostBvhOptions, HostMethod, HostOptimise, SbvhOptions, Termination};
use super::{aac, binned, bonsai, finish, incremental, insertion, optimal, order, ploc, sbvh, sweep};
use hedgerow::Result;
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::layout::{BoxRecord, Record, status};
use hedgerow::bvh::sah::Collapse;
use rayon::prelude::*;
use std::time::Instant;

/// Names the times between calls.
struct Phases {
    since: Instant,
    phases: Vec<(&'static str, f64)>,
}

impl Phases {
    /// The time since the last call was that of this phase.
    fn end(&mut self, name: &'static str) {
        self.phases.push((name, self.since.elapsed().as_secs_f64() * 1e3));
        self.since = Instant::now();
    }
}

/// Builds over `count` primitives with these boxes and records; a primitive is left out where the box says why.
pub(super) fn build_of<R: Record>(
    count: usize,
    bounds: impl Fn(u32) -> Result<Bounds, u32> + Sync,
    record: impl Fn(u32) -> R + Sync,
    (options, heuristic): (&HostBvhOptions, &Heuristic<'_>),
) -> Result<Built<R>> {
    options.check()?;
    heuristic.check(options, count)?;
    // On a thread of the pool: one outside it would wait and be woken again at every parallel step.
    Ok(rayon::scope(|_| build_on_thread(count, &bounds, &record, (options, heuristic))))
}

/// Where nodes of a tree by this heuristic are split no further.
fn leaf_rule<'a>(options: &'a HostBvhOptions, by: &Prepared<'_>) -> LeafRule<'a> {
    // Costs by a heuristic are not those that leaves are made by.
    let is_by_area = matches!(by, Prepared::Area);
    let single = options.is_single() || options.termination == Termination::Sah && !is_by_area;
    LeafRule { costs: &options.collapse, single }
}

/// The tree over `items`, by their codes if the method sorted them. Both are given back before records and nodes want memory.
fn topology(items: Vec<Item>, scale: f32, codes: Vec<u64>, options: &HostBvhOptions, by: &Prepared<'_>) -> Topology {
    let HostBvhOptions { method, collapse, look_ahead, .. } = options;
    let rule = leaf_rule(options, by);
    match method {
        HostMethod::Sweep if *look_ahead > 1 => sweep::build_ahead(&items, rule, *look_ahead),
        HostMethod::Binned(options) if *look_ahead > 1 => binned::build_ahead(items, scale, rule, options, *look_ahead),
        HostMethod::Sweep | HostMethod::Binned(_) => match by {
            Prepared::Area => top_down(&Area, items, scale, rule, method),
            Prepared::Rays(measure) => top_down(&ByRays(&**measure), items, scale, rule, method),
            Prepared::Distribution(rays) => top_down(rays, items, scale, rule, method),
            Prepared::Occlusion(seen) => top_down(seen, items, scale, rule, method),
            Prepared::OcclusionComplete(_) => unreachable!("it was checked that triangles may be split"),
            Prepared::Shadow(rays) => top_down(rays, items, scale, rule, method),
        },
        HostMethod::Bonsai(options) => bonsai::build(items, collapse, rule.single, options),
        HostMethod::Aac(options) => aac::build(&items, &codes, options),
        HostMethod::Ploc { radius } => ploc::build(&items, *radius),
        HostMethod::Incremental(options) => incremental::build(&items, options),
        HostMethod::Sbvh(_) => unreachable!("its tree is over references"),
    }
}

/// By a method whose splits cost what `by` says.
fn top_down(by: &impl SplitCost, items: Vec<Item>, scale: f32, rule: LeafRule<'_>, method: &HostMethod) -> Topology {
    match method {
        HostMethod::Binned(options) => binned::build(by, items, scale, rule, options),
        _ => sweep::build(by, &items, rule),
    }
}

/// The tree over references to `items`.
fn split_tree(
    items: Vec<Item>,
    scene: &sbvh::Scene<'_>,
    rule: LeafRule<'_>,
    options: &SbvhOptions,
    by: &Prepared<'_>,
) -> sbvh::SplitTree {
    match by {
        Prepared::Area => sbvh::build(&Area, items, scene, rule, options),
        Prepared::Rays(measure) => sbvh::build(&ByRays(&**measure), items, scene, rule, options),
        Prepared::Distribution(rays) => sbvh::build(rays, items, scene, rule, options),
        Prepared::Occlusion(seen) => sbvh::build(seen, items, scene, rule, options),
        Prepared::OcclusionComplete(seen) => {
            let planes = if sbvh::can_split(&items, scene, options) { Planes::Space } else { Planes::Objects };
            sbvh::build(&Complete::new(seen, planes, items.len()), items, scene, rule, options)
        }
        Prepared::Shadow(rays) => sbvh::build(rays, items, scene, rule, options),
    }
}

/// What the numbers in a tree's order stand for.
enum Numbered {
    /// Primitives.
    Primitives,
    /// References to them, of which there may be several to one.
    References(Vec<Item>),
}

fn build_on_thread<R: Record>(
    count: usize,
    bounds: &(impl Fn(u32) -> Result<Bounds, u32> + Sync),
    record: &(impl Fn(u32) -> R + Sync),
    (options, heuristic): (&HostBvhOptions, &Heuristic<'_>),
) -> Built<R> {
    let HostBvhOptions { method, codes, collapse, optimise, .. } = options;
    let mut phases = Phases { since: Instant::now(), phases: Vec::new() };
    let mut input = Input::new(count, bounds);
    phases.end("boxes");
    let mut sorted = Vec::new();
    if method.sorts() {
        sorted = order::sort(&mut input, codes.unwrap_or_else(|| Codes::for_count(count as u32)));
        phases.end("order");
    }
    let bounds = |primitive: u32| bounds(primitive).expect("a primitive in the tree has a box");
    let items = std::mem::take(&mut input.items);
    let by = heuristic.prepared((&items, count), &Bounds::of(&input.bounds).scaled(input.item_scale), input.item_scale);
    if *heuristic != Heuristic::Sah {
        phases.end("heuristic");
    }
    let (mut tree, numbered) = match method {
        HostMethod::Sbvh(of_sbvh) => {
            let corners = |primitive| record(primitive).corners();
            let scene =
                sbvh::Scene { corners: &corners, bounds: &bounds, around: &input.bounds, scale: input.item_scale };
            let sbvh::SplitTree { tree, references, is_split } =
                split_tree(items, &scene, leaf_rule(options, &by), of_sbvh, &by);
            input.refer(references.len(), is_split);
            (tree, Numbered::References(references))
        }
        _ => (topology(items, input.item_scale, sorted, options, &by), Numbered::Primitives),
    };
    phases.end("build");
    if *optimise != HostOptimise::Off {
        tree = match &numbered {
            Numbered::Primitives => optimised(tree, &mut input, bounds, options),
            Numbered::References(references) => {
                optimised(tree, &mut input, |number| references[number as usize].bounds(), options)
            }
        };
        phases.end("optimise");
    }
    let tree = match numbered {
        Numbered::Primitives => {
            let records = finish::records(&tree.order, record);
            phases.end("records");
            let collapsed = finish::collapse(&mut tree, &records, collapse, input.scale);
            phases.end("collapse");
            finish::layout(&input, &tree, &collapsed, records)
        }
        Numbered::References(references) => {
            let mut parts: Vec<Item> = tree.order.iter().map(|&number| references[number as usize]).collect();
            let collapsed = sbvh::collapse(&mut tree, &mut parts, collapse, input.scale);
            input.refer(parts.len(), input.is_split);
            phases.end("collapse");
            let primitives: Vec<u32> = parts.iter().map(Item::primitive).collect();
            let records = finish::records(&primitives, record);
            phases.end("records");
            finish::layout_parts(&input, &tree, &collapsed, &parts, records)
        }
    };
    phases.end("layout");
    Built { tree, phases: phases.phases }
}

/// The tree made better, where each number in its order has the box that `bounds` says.
fn optimised(
    mut tree: Topology,
    input: &mut Input,
    bounds: impl Fn(u32) -> Bounds + Sync,
    options: &HostBvhOptions,
) -> Topology {
    let items = |tree: &Topology, scale| -> Vec<Item> {
        let item = |&number: &u32| Item::new(bounds(number), number, 1).scaled(scale);
        tree.order.par_iter().with_min_len(ALONE).map(item).collect()
    };
    match &options.optimise {
        HostOptimise::Off => tree,
        HostOptimise::Reinsertion(options) => {
            let boxed = |number| {
                let Bounds { lo, hi } = bounds(number);
                BoxRecord { lo: lo.to_array(), hi: hi.to_array(), primitive: number }
            };
            let records = finish::records(&tree.order, boxed);
            let collapsed = finish::collapse(&mut tree, &records, &Collapse::OFF, input.scale);
            let tree = finish::layout(input, &tree, &collapsed, records);
            // What was too deep is in leaves from here on.
            input.status |= tree.header.status & status::DEPTH_LIMITED;
            Topology::of_tree(&tree.reinserted(options))
        }
        HostOptimise::Insertion(of_insertion) => {
            let items = items(&tree, input.item_scale);
            insertion::optimise(tree, &items, &options.collapse, of_insertion)
        }
        HostOptimise::Top(of_top) => {
            let items = items(&tree, input.item_scale);
            optimal::top::optimise(tree, &items, &options.collapse, of_top)
        }
    }
}
