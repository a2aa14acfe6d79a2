//! Which boxes of a level are drawn, and how.

use super::projection::Projection;
use crate::experiments::navigate::outline::{Content, Outline};
use hedgerow::trace::{Hit, Ray};
use rayon::prelude::*;
use std::ops::Range;

/// The boxes of a level, as paths of an SVG.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Drawing {
    /// Nodes that have children, and in which some of what is seen lies.
    pub inner: String,
    /// Leaves of that kind.
    pub leaves: String,
    /// Nodes and leaves that hold something, but nothing that is seen.
    pub unseen: String,
    /// Leaves that hold nothing.
    pub empty: String,
    /// Boxes that are drawn; others are outside of the picture or were too many.
    pub drawn: usize,
}

/// Of each node, the rays that end in it.
pub fn seen(outline: &Outline, rays: &[Ray], hits: &[Hit]) -> Vec<u32> {
    let leaf = |(ray, hit): (&Ray, &Hit)| hit.is_some().then(|| outline.leaf_of(ray, hit)).flatten();
    let leaves: Vec<Option<u32>> = rays.par_iter().zip(hits).map(leaf).collect();
    let mut seen = vec![0; outline.nodes.len()];
    for node in leaves.into_iter().flatten().flat_map(|leaf| outline.way_up(leaf)) {
        seen[node as usize] += 1;
    }
    seen
}

impl Drawing {
    /// The boxes of the nodes of a level; where they are more than `most`, those in which most rays end, and of equals the larger.
    pub fn of(outline: &Outline, level: Range<usize>, seen: &[u32], projection: &Projection, most: usize) -> Drawing {
        let mut nodes: Vec<usize> = level.collect();
        nodes.sort_by(|&a, &b| {
            let area = |node: usize| outline.nodes[node].bounds.half_area();
            seen[b].cmp(&seen[a]).then(area(b).total_cmp(&area(a))).then(a.cmp(&b))
        });
        let mut drawing = Drawing::default();
        for node in nodes {
            if drawing.drawn == most {
                break;
            }
            let is_seen = seen[node] > 0;
            let node = &outline.nodes[node];
            let path = match &node.content {
                Content::Leaf(range) if range.is_empty() => &mut drawing.empty,
                _ if !is_seen => &mut drawing.unseen,
                Content::Inner(_) => &mut drawing.inner,
                Content::Leaf(_) => &mut drawing.leaves,
            };
            drawing.drawn += usize::from(projection.draw(&node.bounds, path));
        }
        drawing
    }
}
