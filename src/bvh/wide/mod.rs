//! Wide trees: nodes of up to four or eight children, made of any `Bvh2` so that they cost least.
//!
//! A wide node takes the place of a few binary ones: it begins with the two children of one, and some of them are replaced by
//! their own two as long as there is room. A ray takes fewer steps then, and what a step loads lies together. Which ones is chosen from the
//! leaves up, so that the surface areas of all wide nodes have the least sum (Ylitie, Karras, Laine 2017, section 3.1), or, where rays were
//! counted, so that fewest of them go into wide nodes (as Gu, He, Blelloch 2015, "Ray Specialized Contraction on Bounding Volume
//! Hierarchies", contract by counts). Always replacing the child with the largest area (Wald, Benthin, Boulos 2008, section 3.1) makes
//! 1.35 to 1.6 times as many nodes (docs/notes/rays.md), as it leaves small ones below.
//!
//! Where the children of the source have an order ([`super::child_order`]), those of a wide node lie in their slots as rays shall look
//! into them that end at any hit, and the header says so, too.
//!
//! - [`layout`] are the bytes, [`quantised`] those of the node of 80 bytes, [`pairs`] those of triangles that share an edge;
//! - [`super::twin::wide`] collapses plainly, [`device`] in the caller's command buffer: the same bytes;
//! - [`validate`] walks a wide tree, [`quality`] says what it costs;
//! - [`crate::trace::wide`] traces it.

pub mod device;
pub mod layout;
pub mod pairs;
pub mod quality;
pub mod quantised;
pub mod validate;

/// How the nodes of a wide tree are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Form {
    /// Four children, boxes as floats: 128 bytes.
    Four,
    /// Eight children, boxes as floats: 256 bytes.
    Eight,
    /// Eight children, boxes as bytes in a grid of the node's own: 80 bytes (Ylitie, Karras, Laine 2017).
    EightQuantised,
}

/// How many rays, spread by surface area, stand beside those that were counted.
pub(crate) const PRIOR_RAYS: f32 = 8.0;

/// What rays of work stand beside those that were counted in each child, where children are put in order by hits: as many as
/// [`PRIOR_RAYS`], each of which takes a step of 3 and ends nowhere.
pub(crate) const PRIOR_WORK: f32 = 24.0;

/// Levels of wide nodes that are made to cost least. Nodes further down are opened level by level, so that a node takes in
/// two binary levels of four children and three of eight, however the tree is shaped: what a ray puts off is bounded by that.
/// Trees of scenes end long before.
pub const LEVELS_BY_COST: u32 = 24;

impl Form {
    /// All there are.
    pub const ALL: [Form; 3] = [Form::Four, Form::Eight, Form::EightQuantised];

    /// Children of a node, at most.
    pub const fn width(self) -> u32 {
        match self {
            Form::Four => 4,
            Form::Eight | Form::EightQuantised => 8,
        }
    }

    /// Bytes of a node.
    pub const fn node_bytes(self) -> u64 {
        match self {
            Form::Four => 128,
            Form::Eight => 256,
            Form::EightQuantised => 80,
        }
    }

    /// Whether boxes are bytes.
    pub const fn is_quantised(self) -> bool {
        matches!(self, Form::EightQuantised)
    }

    /// The second word of a structure whose records are those of a `Bvh2` of this kind ([`super::layout::Record::KIND`]).
    pub const fn kind(self, record_kind: u32) -> u32 {
        record_kind & 0xFFF0_FFFF | self.width() << 16 | (self.is_quantised() as u32) << 24
    }

    /// Levels of nodes, at most, of a binary tree of at most [`super::layout::MAX_DEPTH`] levels: [`LEVELS_BY_COST`], and
    /// those that hold the rest; one more where long leaves are nodes.
    pub const fn levels(self) -> u32 {
        let rest = super::layout::MAX_DEPTH - LEVELS_BY_COST;
        match self {
            Form::Four => LEVELS_BY_COST + rest.div_ceil(2),
            Form::Eight => LEVELS_BY_COST + rest.div_ceil(3),
            Form::EightQuantised => LEVELS_BY_COST + rest.div_ceil(3) + 1,
        }
    }

    /// Nodes that a tree of `primitive_count` primitives has at most, 1 at least.
    ///
    /// Where costs choose, a node and one of its children that is a node have w + 2 children together at least, or the child would have
    /// been taken in. So nodes of two children stand below one of w, of which each has w at most: w + 1 nodes for 2w − 1 more leaves, 3/5 of
    /// the leaves where w is 8, and 5/7 where it is 4. Below [`LEVELS_BY_COST`] they are at most 4/7 and 2/3: a node with a node below it
    /// has three or two others beside that one. Where one meets the other, a node by costs may have a child with two leaves whatever its
    /// own number of children is. Two thirds and three quarters are enough for all of it.
    pub const fn nodes_at_most(self, primitive_count: u32) -> u32 {
        let leaves = if primitive_count < 2 { 2 } else { primitive_count as u64 };
        let nodes = match self {
            Form::Four => (3 * leaves - 2) / 4,
            Form::Eight => (2 * leaves - 1) / 3,
            // The root may leave a small child closed that it has room for: one node more.
            Form::EightQuantised => (2 * leaves + 1) / 3,
        };
        nodes as u32
    }

    /// What records call it.
    pub const fn name(self) -> &'static str {
        match self {
            Form::Four => "wide4",
            Form::Eight => "wide8",
            Form::EightQuantised => "wide8q",
        }
    }
}

impl std::fmt::Display for Form {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
