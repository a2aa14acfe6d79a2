//! Wide trees: nodes of up to four or eight children, made of any `Bvh2` by surface area.
//!
//! A wide node takes the place of a few binary ones: it begins with the two children of one, and the child of the largest
//! surface area is replaced by its own two as long as there is room (Wald, Benthin, Boulos 2008, section 3.1). A ray takes
//! fewer steps then, and what a step loads lies together. Where rays were counted, the child that most of them went into may be
//! replaced instead (Gu, He, Blelloch 2015, "Ray Specialized Contraction on Bounding Volume Hierarchies").
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

/// Levels of wide nodes that are opened by surface area or by visits. Nodes further down are opened level by level, so that a node takes in
/// two binary levels of four children and three of eight, however the tree is shaped: what a ray puts off is bounded by that.
/// Trees of scenes end long before.
pub const LEVELS_BY_AREA: u32 = 24;

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

    /// Levels of nodes, at most, of a binary tree of at most [`super::layout::MAX_DEPTH`] levels: [`LEVELS_BY_AREA`], and
    /// those that hold the rest; one more where long leaves are nodes.
    pub const fn levels(self) -> u32 {
        let rest = super::layout::MAX_DEPTH - LEVELS_BY_AREA;
        match self {
            Form::Four => LEVELS_BY_AREA + rest.div_ceil(2),
            Form::Eight => LEVELS_BY_AREA + rest.div_ceil(3),
            Form::EightQuantised => LEVELS_BY_AREA + rest.div_ceil(3) + 1,
        }
    }

    /// Nodes that a tree of `primitive_count` primitives has at most, 1 at least.
    ///
    /// A node with room left has leaves alone for children, two at least. Nodes are the most where all others are full and each
    /// of those that they can hold below them has two leaves: of `f` full ones, (w − 1)·f + 1.
    pub const fn nodes_at_most(self, primitive_count: u32) -> u32 {
        let leaves = if primitive_count < 2 { 2 } else { primitive_count };
        self.width() * (leaves - 2) / (2 * (self.width() - 1)) + 1
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
