//! What boxes cost: by area, by what rays did in a tree, by the flux on a grid, by the rays of a sample themselves.

use super::flux::Flux;
use super::frames::{Sample, Segment};
use super::search::{LinkedTree, Measure, Move};
use hedgerow::geometry::Aabb;

/// As the library does it.
#[derive(Default)]
pub struct Area(Vec<f32>);

/// Of each slot, a cost of its box.
fn of_slots(tree: &LinkedTree, cost: impl Fn(u32, &Aabb) -> f32) -> Vec<f32> {
    let nodes = tree.tree.nodes.iter().enumerate();
    nodes.map(|(slot, node)| if node.is_used() { cost(slot as u32, &tree.bounds(slot as u32)) } else { 0.0 }).collect()
}

fn sum(costs: &[f32]) -> f64 {
    costs.iter().map(|&cost| f64::from(cost)).sum()
}

impl Measure for Area {
    type Here = ();

    fn prepare(&mut self, tree: &LinkedTree, _: u32) {
        self.0 = of_slots(tree, |_, bounds| tree.area(bounds));
    }

    fn node(&self, _: &LinkedTree, slot: u32) -> f32 {
        self.0[slot as usize]
    }

    fn moving(&self, tree: &LinkedTree, link: u32) -> f32 {
        tree.area(&tree.child(link).bounds())
    }

    fn shrunk(&self, tree: &LinkedTree, _: u32, _: u32, left: &Aabb) -> f32 {
        tree.area(left)
    }

    fn begin(&self, _: &LinkedTree, _: u32, _: &mut Vec<u32>) {}

    fn merged(&self, tree: &LinkedTree, (): (), _: [u32; 2], merged: &Aabb, _: &mut Vec<u32>) -> (f32, ()) {
        (tree.area(merged), ())
    }
}

/// How counts become the cost of a box that no ray has met yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// The study's: the density of rays at what is there, times the new area.
    Density,
    /// The same, within a fourth and four times of what the area gives.
    Clamped,
    /// As many as went into both, and for what is between them the density in the box around; no fewer than went into either.
    Union,
}

/// By what rays did in the tree. A share of the cost is by area.
pub struct Counts<'a> {
    pub sample: &'a Sample,
    pub rule: Rule,
    /// How much of the whole cost is by rays.
    pub share: f32,
    /// Rounds from one count to the next.
    pub every: u32,
    by_area: f32,
    by_rays: f32,
    /// Rays of each link, and of the root.
    entered: Vec<f32>,
    rays: f32,
    nodes: Vec<f32>,
    density: Vec<f32>,
}

impl<'a> Counts<'a> {
    pub fn new(sample: &'a Sample, rule: Rule, share: f32, every: u32) -> Counts<'a> {
        let (entered, nodes, density) = (Vec::new(), Vec::new(), Vec::new());
        Counts { sample, rule, share, every, by_area: 1.0, by_rays: 0.0, entered, rays: 0.0, nodes, density }
    }

    fn entered_slot(&self, tree: &LinkedTree, slot: u32) -> f32 {
        if slot == tree.tree.header.root.index { self.rays } else { self.entered[tree.parents[slot as usize] as usize] }
    }

    fn cost(&self, area: f32, rays: f32) -> f32 {
        self.by_area * area + self.by_rays * rays
    }

    /// Expected rays an area at each link, from the root down: the mean of a rate with eight rays before at its parent's density.
    fn densities(&self, tree: &LinkedTree) -> Vec<f32> {
        const BEFORE: f32 = 8.0;
        let mut density = vec![0.0; self.entered.len()];
        let root = tree.tree.header.root;
        let mut open = vec![(root, self.rays / tree.area(&root.bounds()).max(f32::MIN_POSITIVE))];
        while let Some((child, above)) = open.pop() {
            for side in 0..2 {
                let link = 2 * child.index + side;
                let below = tree.child(link);
                let area = tree.area(&below.bounds());
                let here = (self.entered[link as usize] + BEFORE) / (area + BEFORE / above.max(1e-30));
                density[link as usize] = here;
                if !below.is_leaf() {
                    open.push((below, here));
                }
            }
        }
        density
    }

    fn rays_of_merged(&self, tree: &LinkedTree, here: (f32, f32), [at, link]: [u32; 2], area: f32) -> f32 {
        let [there, moving] = [at, link].map(|link| self.entered[link as usize]);
        let mean = self.rays / tree.area(&tree.tree.header.root.bounds());
        match self.rule {
            Rule::Density => self.density[at as usize] * area,
            Rule::Clamped => (self.density[at as usize] * area).clamp(0.25 * mean * area, 4.0 * mean * area),
            Rule::Union => {
                let [a, b] = [at, link].map(|link| tree.area(&tree.child(link).bounds()));
                let (rays, around) = here;
                let between = (area - a - b).max(0.0) * rays / around.max(f32::MIN_POSITIVE);
                (there + moving + between).min(rays).max(there.max(moving))
            }
        }
    }
}

impl Measure for Counts<'_> {
    /// Rays and area of the box around.
    type Here = (f32, f32);

    fn prepare(&mut self, tree: &LinkedTree, round: u32) {
        if round.is_multiple_of(self.every) {
            let counts = self.sample.entered(&tree.tree);
            self.entered = counts.iter().map(|&count| count as f32).collect();
            self.rays = self.sample.rays.len() as f32;
        }
        if self.rule != Rule::Union {
            self.density = self.densities(tree);
        }
        let areas = of_slots(tree, |_, bounds| tree.area(bounds));
        if round == 0 {
            let rays = of_slots(tree, |slot, _| self.entered_slot(tree, slot));
            (self.by_area, self.by_rays) =
                ((f64::from(1.0 - self.share) / sum(&areas)) as f32, (f64::from(self.share) / sum(&rays)) as f32);
        }
        self.nodes = match self.rule {
            Rule::Union => of_slots(tree, |slot, bounds| self.cost(tree.area(bounds), self.entered_slot(tree, slot))),
            _ => of_slots(tree, |slot, bounds| {
                let area = tree.area(bounds);
                let root = slot == tree.tree.header.root.index;
                let link = if root { 0 } else { tree.parents[slot as usize] };
                let rays = if root { self.rays } else { self.rays_of_merged(tree, (0.0, 0.0), [link, link], area) };
                self.cost(area, rays)
            }),
        };
    }

    fn node(&self, _: &LinkedTree, slot: u32) -> f32 {
        self.nodes[slot as usize]
    }

    fn moving(&self, tree: &LinkedTree, link: u32) -> f32 {
        let area = tree.area(&tree.child(link).bounds());
        let rays = match self.rule {
            Rule::Union => self.entered[link as usize],
            // The study's: no bound, as the density there may be less.
            _ => self.rays_of_merged(tree, (0.0, 0.0), [link, link], area),
        };
        self.cost(area, rays)
    }

    fn shrunk(&self, tree: &LinkedTree, slot: u32, other: u32, left: &Aabb) -> f32 {
        let area = tree.area(left);
        let rays = match self.rule {
            Rule::Union => {
                let whole = tree.area(&tree.bounds(slot)).max(f32::MIN_POSITIVE);
                (self.entered_slot(tree, slot) * area / whole).max(self.entered[other as usize])
            }
            _ if slot == tree.tree.header.root.index => self.rays,
            _ => {
                let link = tree.parents[slot as usize];
                self.rays_of_merged(tree, (0.0, 0.0), [link, link], area)
            }
        };
        self.cost(area, rays)
    }

    fn begin(&self, tree: &LinkedTree, pivot: u32, _: &mut Vec<u32>) -> (f32, f32) {
        (self.entered_slot(tree, pivot), tree.area(&tree.bounds(pivot)))
    }

    fn merged(
        &self,
        tree: &LinkedTree,
        here: (f32, f32),
        links: [u32; 2],
        merged: &Aabb,
        _: &mut Vec<u32>,
    ) -> (f32, (f32, f32)) {
        let area = tree.area(merged);
        let rays = self.rays_of_merged(tree, here, links, area);
        (self.cost(area, rays), (rays, area))
    }

    fn moves(&mut self, tree: &LinkedTree, m: &Move, top: u32) {
        let (parent, moving) = (m.link / 2, self.entered[m.link as usize]);
        let up = tree.parents[parent as usize];
        self.entered[up as usize] = self.entered[m.link as usize ^ 1];
        // What is there may be what has just moved up.
        let to = if m.to == m.link ^ 1 { up } else { m.to };
        let there = self.entered[to as usize];
        self.entered[m.link as usize ^ 1] = there;
        let mut at = m.to;
        loop {
            let most = if at / 2 == tree.tree.header.root.index { self.rays } else { self.entered_slot(tree, at / 2) };
            let here = self.entered[at as usize];
            self.entered[at as usize] = (here + moving).min(most.max(here)).max(moving);
            if at / 2 == top || at / 2 == m.pivot {
                break;
            }
            at = tree.parents[at as usize / 2];
        }
    }
}

/// By the flux of the sample on a grid.
pub struct ByFlux<'a> {
    pub flux: &'a Flux,
    pub share: f32,
    pub by_area: f32,
    pub by_rays: f32,
    pub nodes: Vec<f32>,
}

impl ByFlux<'_> {
    fn cost(&self, tree: &LinkedTree, bounds: &Aabb) -> f32 {
        self.by_area * tree.area(bounds) + self.by_rays * self.flux.rays(bounds)
    }
}

impl Measure for ByFlux<'_> {
    type Here = ();

    fn prepare(&mut self, tree: &LinkedTree, round: u32) {
        if round == 0 {
            let areas = of_slots(tree, |_, bounds| tree.area(bounds));
            let rays = of_slots(tree, |_, bounds| self.flux.rays(bounds));
            (self.by_area, self.by_rays) =
                ((f64::from(1.0 - self.share) / sum(&areas)) as f32, (f64::from(self.share) / sum(&rays)) as f32);
        }
        self.nodes = of_slots(tree, |_, bounds| self.cost(tree, bounds));
    }

    fn node(&self, _: &LinkedTree, slot: u32) -> f32 {
        self.nodes[slot as usize]
    }

    fn moving(&self, tree: &LinkedTree, link: u32) -> f32 {
        self.cost(tree, &tree.child(link).bounds())
    }

    fn shrunk(&self, tree: &LinkedTree, _: u32, _: u32, left: &Aabb) -> f32 {
        self.cost(tree, left)
    }

    fn begin(&self, _: &LinkedTree, _: u32, _: &mut Vec<u32>) {}

    fn merged(&self, tree: &LinkedTree, (): (), _: [u32; 2], merged: &Aabb, _: &mut Vec<u32>) -> (f32, ()) {
        (self.cost(tree, merged), ())
    }
}

/// By how many segments of the sample meet a box.
pub struct Exact<'a> {
    pub segments: &'a [Segment],
    pub share: f32,
    by_area: f32,
    by_rays: f32,
    /// Of each slot, where its rays are in the list of all.
    lists: Vec<(u32, u32)>,
    all: Vec<u32>,
    nodes: Vec<f32>,
}

impl<'a> Exact<'a> {
    pub fn new(segments: &'a [Segment], share: f32) -> Exact<'a> {
        Exact { segments, share, by_area: 1.0, by_rays: 0.0, lists: Vec::new(), all: Vec::new(), nodes: Vec::new() }
    }

    fn cost(&self, area: f32, rays: usize) -> f32 {
        self.by_area * area + self.by_rays * rays as f32
    }

    fn count(&self, among: &[u32], bounds: &Aabb) -> usize {
        among.iter().filter(|&&ray| self.segments[ray as usize].meets(bounds)).count()
    }

    fn of_slot(&self, slot: u32) -> &[u32] {
        let (first, count) = self.lists[slot as usize];
        &self.all[first as usize..][..count as usize]
    }
}

impl Measure for Exact<'_> {
    type Here = (u32, u32);

    fn prepare(&mut self, tree: &LinkedTree, round: u32) {
        let root = tree.tree.header.root;
        let areas = of_slots(tree, |_, bounds| tree.area(bounds));
        self.lists = vec![(0, 0); areas.len()];
        self.all.clear();
        let inside = |&ray: &u32| self.segments[ray as usize].meets(&root.bounds());
        let rays: Vec<u32> = (0..self.segments.len() as u32).filter(inside).collect();
        self.all.extend(rays);
        self.lists[root.index as usize] = (0, self.all.len() as u32);
        let mut open = vec![root.index];
        while let Some(slot) = open.pop() {
            let (first, count) = self.lists[slot as usize];
            for link in [2 * slot, 2 * slot + 1] {
                let child = tree.child(link);
                if child.is_leaf() {
                    continue;
                }
                let (from, bounds) = (self.all.len() as u32, child.bounds());
                for i in first..first + count {
                    let ray = self.all[i as usize];
                    if self.segments[ray as usize].meets(&bounds) {
                        self.all.push(ray);
                    }
                }
                self.lists[child.index as usize] = (from, self.all.len() as u32 - from);
                open.push(child.index);
            }
        }
        if round == 0 {
            let rays: u64 = self.lists.iter().map(|list| u64::from(list.1)).sum();
            (self.by_area, self.by_rays) =
                ((f64::from(1.0 - self.share) / sum(&areas)) as f32, (f64::from(self.share) / rays as f64) as f32);
        }
        self.nodes = areas.iter().zip(&self.lists).map(|(&area, list)| self.cost(area, list.1 as usize)).collect();
    }

    fn node(&self, _: &LinkedTree, slot: u32) -> f32 {
        self.nodes[slot as usize]
    }

    fn moving(&self, tree: &LinkedTree, link: u32) -> f32 {
        let child = tree.child(link);
        if child.is_leaf() {
            self.cost(tree.area(&child.bounds()), self.count(self.of_slot(link / 2), &child.bounds()))
        } else {
            self.nodes[child.index as usize]
        }
    }

    fn shrunk(&self, tree: &LinkedTree, slot: u32, _: u32, left: &Aabb) -> f32 {
        self.cost(tree.area(left), self.count(self.of_slot(slot), left))
    }

    fn begin(&self, _: &LinkedTree, pivot: u32, buffer: &mut Vec<u32>) -> (u32, u32) {
        buffer.extend_from_slice(self.of_slot(pivot));
        (0, buffer.len() as u32)
    }

    fn merged(
        &self,
        tree: &LinkedTree,
        (first, count): (u32, u32),
        _: [u32; 2],
        merged: &Aabb,
        buffer: &mut Vec<u32>,
    ) -> (f32, (u32, u32)) {
        let from = buffer.len() as u32;
        for i in first..first + count {
            let ray = buffer[i as usize];
            if self.segments[ray as usize].meets(merged) {
                buffer.push(ray);
            }
        }
        let here = (from, buffer.len() as u32 - from);
        (self.cost(tree.area(merged), here.1 as usize), here)
    }
}
