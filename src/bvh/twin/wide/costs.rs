//! Which binary nodes a wide node takes in, so that all wide nodes together cost least (Ylitie, Karras, Laine 2017, section 3.1; leaves stay
//! as they are). The twin of glsl/bvh/wide/costs.glsl and glsl/bvh/wide/choice.glsl.
//!
//! A wide node costs the surface area of its binary node, or what rays were counted there. Let a subtree take up to i places among the
//! children of a wide node. Then C(i) is the least cost of the wide nodes in it, and D(j) what it is where the binary node itself is opened
//! and its children share j places:
//!
//! - D(j) = min over 0 < k < j of C_left(k) + C_right(j − k);
//! - C(1) = D(width) + its own cost, as it is a wide node then;
//! - C(i) = min(D(i), C(i − 1)).
//!
//! A leaf costs nothing here, for no choice changes what it does.

use crate::bvh::counts::LinkCount;
use crate::bvh::layout::{Bvh2, Child, Record};
use crate::bvh::wide::PRIOR_RAYS;

/// What was chosen for a binary node.
///
/// Bits 3j − 6 and two more: of j places, from 2 to 8, how many the left child gets. Bit 19 + i: C(i) is less than C(i − 1), for i from 2 to
/// 7. Bits 27 to 29: how many children it has as a wide node, less 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Choice(u32);

impl Choice {
    /// How many of `places` the left child gets.
    pub fn left_of(self, places: u32) -> u32 {
        self.0 >> (3 * places - 6) & 7
    }

    /// How many of up to `places` places the subtree takes: more would not make it cheaper.
    pub fn places_of(self, places: u32) -> u32 {
        let cheaper = self.0 >> 21 & ((1 << (places - 1)) - 1);
        33 - cheaper.leading_zeros()
    }

    /// How many children it has as a wide node.
    pub fn children(self) -> u32 {
        2 + (self.0 >> 27 & 7)
    }
}

/// For each node slot; nothing for a tree that is a leaf.
pub(super) fn choices_of<R: Record>(tree: &Bvh2<R>, width: u32, visits: &[LinkCount]) -> Vec<Choice> {
    let mut choices = vec![Choice::default(); tree.nodes.len()];
    let root = &tree.header.root;
    if root.is_leaf() {
        return choices;
    }
    let mut costs = vec![[0.0; 8]; tree.nodes.len()];
    // Each node behind its parent, with the link that names it.
    let mut order = vec![(*root, None)];
    for at in 0.. {
        let Some(&(child, _)) = order.get(at) else { break };
        let links = (2 * child.index..).zip(tree.nodes[child.index as usize].children);
        order.extend(links.filter(|(_, child)| !child.is_leaf()).map(|(link, child)| (child, Some(link))));
    }
    let scale = tree.header.area_scale;
    let whole_area = root.bounds().scaled_half_area(scale);
    for (child, link) in order.into_iter().rev() {
        let children = tree.nodes[child.index as usize].children;
        let area = children[0].bounds().union(&children[1].bounds()).scaled_half_area(scale);
        let own = match link.and_then(|link: u32| visits.get(link as usize)) {
            Some(count) => count.entered as f32 * whole_area + PRIOR_RAYS * area,
            None => area,
        };
        let (choice, of_places) = choose(&children, &choices, &costs, width as usize, own);
        choices[child.index as usize] = choice;
        costs[child.index as usize] = of_places;
    }
    choices
}

/// What is chosen for a node of these children that costs so much itself, and what it costs in so many places.
fn choose(children: &[Child; 2], choices: &[Choice], costs: &[[f32; 8]], width: usize, own: f32) -> (Choice, [f32; 8]) {
    let [left, right] = children.map(|child| if child.is_leaf() { [0.0; 8] } else { costs[child.index as usize] });
    let mut word = 0;
    // D(j), and how many places the left child gets, of equal ones the least.
    let opened: [f32; 9] = std::array::from_fn(|places| {
        let mut best = (f32::INFINITY, 1);
        for k in 1..places.min(width + 1) {
            let cost = left[k] + right[places - k];
            if cost < best.0 {
                best = (cost, k as u32);
            }
        }
        if (2..=width).contains(&places) {
            word |= best.1 << (3 * places - 6);
        }
        best.0
    });
    let mut of_places = [0.0; 8];
    of_places[1] = opened[width] + own;
    for i in 2..width {
        if opened[i] < of_places[i - 1] {
            word |= 1 << (19 + i);
        }
        of_places[i] = opened[i].min(of_places[i - 1]);
    }
    let left_gets = Choice(word).left_of(width as u32);
    let takes = |child: &Child, places: u32| {
        if child.is_leaf() { 1 } else { choices[child.index as usize].places_of(places) }
    };
    let both = takes(&children[0], left_gets) + takes(&children[1], width as u32 - left_gets);
    (Choice(word | (both - 2) << 27), of_places)
}
