//! A tree as nodes with boxes, level by level, whatever its layout: what is drawn of it.

use crate::subjects::Subject;
use crate::{Error, Result};
use hedgerow::bvh::layout::{Bvh2, Child, SLACK};
use hedgerow::geometry::Aabb;
use hedgerow::kdtree::layout::{self as kd, KdTree};
use hedgerow::trace::{Hit, Ray};
use std::ops::Range;

/// A node with its box: of a kd-tree its cell.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlineNode {
    /// The box.
    pub bounds: Aabb,
    /// The node above; of the root itself.
    pub parent: u32,
    /// What is below.
    pub content: Content,
}

/// What is below a node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Content {
    /// Its children.
    Inner([u32; 2]),
    /// Its part of [`Outline::primitives`]; of an empty leaf, nothing.
    Leaf(Range<usize>),
}

/// A tree on the host, as nodes with boxes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    /// The nodes, the root first, level by level.
    pub nodes: Vec<OutlineNode>,
    /// The nodes of each level.
    pub levels: Vec<Range<usize>>,
    /// Primitives, those of each leaf together.
    pub primitives: Vec<u32>,
    /// The longest side of a triangle that counts when a hit is looked for beside its ray; 0 where boxes hold all of it.
    reach: f32,
}

/// Figures of a level.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OutlineLevel {
    /// Nodes that have children.
    pub inner: u64,
    /// Leaves, the empty ones among them.
    pub leaves: u64,
    /// Leaves without a primitive.
    pub empty_leaves: u64,
    /// Primitives in all leaves.
    pub refs: u64,
    /// What it adds to the SAH cost.
    pub cost: f64,
}

impl OutlineLevel {
    /// All nodes.
    pub fn nodes(&self) -> u64 {
        self.inner + self.leaves
    }
}

impl Outline {
    /// The tree that a subject has built.
    ///
    /// # Errors
    /// [`Error::Argument`] if its tree is not ours to read; the device failed.
    pub fn of(subject: &mut dyn Subject) -> Result<Outline> {
        if let Some(tree) = subject.kd_tree()? {
            return Ok(Outline::of_kd_tree(&tree));
        }
        match subject.tree()? {
            Some(tree) => Ok(Outline::of_bvh(&tree)),
            None => Err(Error::Argument(format!(
                "the tree of {} is not ours to read; choose one of our builders, such as lbvh or kd-binned",
                subject.builder()
            ))),
        }
    }

    /// Every node of a BVH.
    pub fn of_bvh(tree: &Bvh2) -> Outline {
        let mut outline = Outline::default();
        if tree.header.active == 0 {
            return outline;
        }
        outline.grow((tree.header.root, tree.header.root.bounds()), |outline, child: &Child, _| {
            if child.is_leaf() {
                let range = child.index as usize..(child.index + child.count) as usize;
                return Err(outline.leaf(tree.records[range].iter().map(|record| record.primitive)));
            }
            Ok(tree.nodes[child.index as usize].children.map(|child| (child, child.bounds())))
        });
        outline
    }

    /// Every cell of a kd-tree, those of empty leaves among them.
    pub fn of_kd_tree(tree: &KdTree) -> Outline {
        let mut outline = Outline { reach: tree.header.reach, ..Outline::default() };
        if tree.nodes.is_empty() {
            return outline;
        }
        outline.grow((Some(0), tree.header.cell()), |outline, node: &Option<u32>, cell| {
            let Some(node) = node else { return Err(outline.leaf([].into_iter())) };
            match tree.nodes[*node as usize].content() {
                kd::KdContent::Leaf(range) => {
                    let records = tree.references[range].iter();
                    Err(outline.leaf(records.map(|&record| tree.records[record as usize].primitive)))
                }
                kd::KdContent::Inner(inner) => {
                    let [left, right] = inner.halves(cell);
                    Ok([(inner.children[0], left), (inner.children[1], right)])
                }
            }
        });
        outline
    }

    fn leaf(&mut self, primitives: impl Iterator<Item = u32>) -> Range<usize> {
        let first = self.primitives.len();
        self.primitives.extend(primitives);
        first..self.primitives.len()
    }

    /// Adds nodes level by level; `open` gives a node's children, or its leaf.
    fn grow<N>(
        &mut self,
        root: (N, Aabb),
        open: impl Fn(&mut Outline, &N, &Aabb) -> std::result::Result<[(N, Aabb); 2], Range<usize>>,
    ) {
        let mut level = vec![(root.0, root.1, 0)];
        while !level.is_empty() {
            let first = self.nodes.len();
            let below = first + level.len();
            let mut next = Vec::new();
            for (at, bounds, parent) in level {
                let own = self.nodes.len() as u32;
                let content = match open(self, &at, &bounds) {
                    Ok(children) => {
                        let left = (below + next.len()) as u32;
                        next.extend(children.map(|(child, bounds)| (child, bounds, own)));
                        Content::Inner([left, left + 1])
                    }
                    Err(leaf) => Content::Leaf(leaf),
                };
                self.nodes.push(OutlineNode { bounds, parent, content });
            }
            self.levels.push(first..below);
            level = next;
        }
    }

    /// The figures of each level with the costs of a step and of a test; their costs add up to that of the tree.
    pub fn figures(&self, c_t: f64, c_i: f64) -> Vec<OutlineLevel> {
        let whole = self.nodes.first().map_or(0.0, |root| half_area(&root.bounds));
        let share = |bounds: &Aabb| if whole > 0.0 { half_area(bounds) / whole } else { 0.0 };
        let of_level = |range: &Range<usize>| {
            let mut level = OutlineLevel::default();
            for node in &self.nodes[range.clone()] {
                match &node.content {
                    Content::Inner(_) => {
                        level.inner += 1;
                        level.cost += c_t * share(&node.bounds);
                    }
                    Content::Leaf(range) => {
                        level.leaves += 1;
                        level.empty_leaves += u64::from(range.is_empty());
                        level.refs += range.len() as u64;
                        level.cost += c_i * share(&node.bounds) * range.len() as f64;
                    }
                }
            }
            level
        };
        self.levels.iter().map(of_level).collect()
    }

    /// The leaf in which `ray` finds `hit`: one that has the primitive and holds the point, but for what rounding may move it.
    pub fn leaf_of(&self, ray: &Ray, hit: &Hit) -> Option<u32> {
        let point: [f32; 3] = std::array::from_fn(|i| ray.origin[i] + hit.t * ray.direction[i]);
        let longest = ray.direction.iter().fold(0f32, |m, d| m.max(d.abs()));
        let farthest = ray.origin.iter().chain(&point).fold(0f32, |m, x| m.max(x.abs()));
        let slack = 2.0 * SLACK * (hit.t.abs() * longest + self.reach + farthest);
        let holds = |node: u32| {
            let bounds = &self.nodes[node as usize].bounds;
            (0..3).all(|i| bounds.lo[i] - slack <= point[i] && point[i] <= bounds.hi[i] + slack)
        };
        let mut stack = Vec::from_iter((!self.nodes.is_empty()).then_some(0));
        while let Some(node) = stack.pop() {
            match &self.nodes[node as usize].content {
                Content::Inner(children) => stack.extend(children.iter().filter(|&&child| holds(child))),
                Content::Leaf(range) if self.primitives[range.clone()].contains(&hit.primitive) => return Some(node),
                Content::Leaf(_) => {}
            }
        }
        None
    }

    /// The nodes from one up to the root.
    pub fn way_up(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        let above = |&node: &u32| (node != 0).then(|| self.nodes[node as usize].parent);
        std::iter::successors(Some(node), above)
    }
}

fn half_area(bounds: &Aabb) -> f64 {
    let [x, y, z]: [f64; 3] = std::array::from_fn(|i| f64::from(bounds.hi[i]) - f64::from(bounds.lo[i]));
    if x < 0.0 { 0.0 } else { x * y + y * z + z * x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rays::kinds::{self, RayKind, RayOptions};
    use crate::scene::{self, LoadOptions, Scene};
    use crate::subjects::builders::Spec;
    use hedgerow::trace::Query;

    const BUILDERS: [&str; 5] = ["lbvh-host", "lbvh-host:collapse=off", "sweep", "kd-exact", "kd-binned"];

    fn scene() -> Scene {
        scene::load("gen:soup:2000:3", &LoadOptions::default()).expect("a generator")
    }

    #[test]
    fn levels_add_up_to_the_quality_of_the_tree() {
        let scene = scene();
        for builder in BUILDERS {
            let mut subject = builder.parse::<Spec>().expect(builder).make(None, &scene.mesh).expect(builder);
            subject.build().expect(builder);
            let quality = subject.quality(3.0, 2.0).expect(builder);
            let outline = Outline::of(subject.as_mut()).expect(builder);
            let levels = outline.figures(3.0, 2.0);
            let sum = |of: fn(&OutlineLevel) -> u64| Some(levels.iter().map(of).sum::<u64>());
            assert_eq!(sum(|l| l.inner), quality.inner, "{builder}");
            assert_eq!(sum(|l| l.leaves), quality.leaves, "{builder}");
            assert_eq!(sum(|l| l.empty_leaves), quality.empty_leaves, "{builder}");
            assert_eq!(sum(|l| l.refs), quality.refs, "{builder}");
            assert_eq!(Some(levels.len() as u64 - 1), quality.depth_max, "{builder}");
            let cost: f64 = levels.iter().map(|l| l.cost).sum();
            assert!((cost / quality.sah.expect("told") - 1.0).abs() < 1e-6, "{builder}: {cost}");
            for (i, node) in outline.nodes.iter().enumerate() {
                let Content::Inner(children) = node.content else { continue };
                assert!(children.iter().all(|&c| outline.nodes[c as usize].parent == i as u32), "{builder}");
                assert!(children.iter().all(|&c| node.bounds.contains(&outline.nodes[c as usize].bounds)), "{builder}");
            }
        }
    }

    #[test]
    fn every_hit_is_in_a_leaf_that_has_its_triangle() {
        let scene = scene();
        let options = RayOptions { size: [64, 48], seed: 1 };
        let rays = kinds::generate(RayKind::Primary, &scene, &options, &mut |_| Ok(Vec::new())).expect("rays");
        for builder in BUILDERS {
            let mut subject = builder.parse::<Spec>().expect(builder).make(None, &scene.mesh).expect(builder);
            subject.build().expect(builder);
            subject.set_rays(&rays).expect(builder);
            subject.trace(Query::ClosestHit).expect(builder);
            let hits = subject.hits().expect(builder);
            let outline = Outline::of(subject.as_mut()).expect(builder);
            let met = || rays.iter().zip(&hits).filter(|(_, hit)| hit.is_some());
            assert!(met().count() > 100, "{builder}: {}", met().count());
            for (ray, hit) in met() {
                let leaf = outline.leaf_of(ray, hit).unwrap_or_else(|| panic!("{builder}: {hit:?} is in no leaf"));
                let way: Vec<u32> = outline.way_up(leaf).collect();
                assert_eq!((way[0], way.last()), (leaf, Some(&0)), "{builder}");
            }
        }
    }

    #[test]
    fn an_empty_tree_has_no_level() {
        let empty = crate::scene::Mesh::default();
        for builder in ["lbvh-host", "kd-exact"] {
            let mut subject = builder.parse::<Spec>().expect(builder).make(None, &empty).expect(builder);
            subject.build().expect(builder);
            assert_eq!(Outline::of(subject.as_mut()).expect(builder).levels.len(), 0, "{builder}");
        }
    }
}
