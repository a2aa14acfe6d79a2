//! Kd-trees that the host builds every frame, or merges into the static one.

use crate::Result;
use crate::measure::MemoryRecord;
use crate::scene::{Frame, Group, Mesh};
use crate::subjects::builders::Spec;
use crate::subjects::host_rays::{KdRays, Numbered, timed};
use crate::subjects::{BuildRun, KD_TREE, Subject};
use hedgerow::kdtree::layout::{KdTree, SpareRoom};
use hedgerow::kdtree::termination::Costs;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::kdtree::merge::Merged;
use hedgerow_host::kdtree::{HostKdOptions, build};
use rayon::prelude::*;
use std::borrow::Cow;

/// Room for merging, for each triangle that moves: what scenes that were measured need, twice over; and for those with few. More
/// is made where it is too little.
const ROOM_EACH: u32 = 24;
const ROOM_AT_LEAST: u32 = 1 << 16;

/// Trees on the host, traced one after the other there or on the device.
pub struct OnHost<'a> {
    builder: String,
    options: HostKdOptions,
    parts: Vec<Part>,
    trees: Trees,
    rays: KdRays<'a>,
    /// Of all trees, as they were built last.
    bytes: u64,
}

/// What is built every frame.
struct Part {
    group: Group,
    name: String,
    first: u32,
    mesh: Mesh,
}

/// What is traced.
pub enum Trees {
    /// The tree of what stands still, and one a part with the number of its first primitive.
    Apart { still: Option<Box<KdTree>>, parts: Vec<(KdTree, u32)> },
    /// One, which the parts are merged into.
    Merged(Box<Merged>),
}

impl Trees {
    /// None but that of what stands still, if anything does.
    pub fn beside(still: Option<KdTree>) -> Trees {
        Trees::Apart { still: still.map(Box::new), parts: Vec::new() }
    }

    /// That of what stands still, with room for `moving` triangles.
    ///
    /// # Errors
    /// Too little memory.
    pub fn merged_into(still: KdTree, moving: u32, costs: Costs) -> Result<Trees> {
        let each = moving.saturating_mul(ROOM_EACH).saturating_add(ROOM_AT_LEAST);
        let still = still.with_room(SpareRoom { nodes: each, references: each, records: moving })?;
        Ok(Trees::Merged(Box::new(Merged::new(still, costs))))
    }

    /// Each with the number of its first primitive.
    fn all(&mut self) -> Result<Vec<Numbered<'_>>> {
        Ok(match self {
            Trees::Apart { still, parts } => {
                let parts = parts.iter().map(|(tree, first)| (tree, *first));
                still.iter().map(|still| (&**still, 0)).chain(parts).collect()
            }
            Trees::Merged(merged) => vec![(merged.tree()?, 0)],
        })
    }
}

impl<'a> OnHost<'a> {
    /// Builds a tree of each of `groups` every frame, beside or into `trees`, which `rays` go through.
    pub fn new(
        builder: &Spec,
        options: HostKdOptions,
        (first, groups): (&Frame<'_>, Vec<Group>),
        trees: Trees,
        rays: KdRays<'a>,
    ) -> OnHost<'a> {
        let part = |group: Group| {
            let name = match group {
                Group::Object(k) => format!("{k}: {}", first.dynamic.objects[k].name),
                _ => String::new(),
            };
            Part { group, name, first: first.first(group), mesh: Mesh::default() }
        };
        let parts = groups.into_iter().map(part).collect();
        OnHost { builder: builder.to_string(), options, parts, trees, rays, bytes: 0 }
    }

    fn build_once(&mut self) -> Result<()> {
        if let Trees::Merged(merged) = &mut self.trees {
            merged.restore();
        }
        let tree = |part: &Part| build(&part.mesh.positions, &part.mesh.triangles, &self.options);
        let built: Vec<KdTree> = self.parts.par_iter().map(tree).collect::<hedgerow::Result<_>>()?;
        match &mut self.trees {
            Trees::Apart { parts, .. } => {
                *parts = built.into_iter().zip(self.parts.iter().map(|part| part.first)).collect();
            }
            Trees::Merged(merged) => {
                for (part, tree) in self.parts.iter().zip(built) {
                    merged.insert(&part.name, part.first, tree)?;
                }
                merged.tree()?;
            }
        }
        Ok(())
    }
}

/// Twice the room for what is merged, if that helps.
fn enlarge(merged: &mut Merged, costs: Costs) -> Result<()> {
    let still = merged.restore().clone();
    let header = &still.header;
    let more = |room: u32, count: u32| (room - count).max(ROOM_AT_LEAST).saturating_mul(2);
    let room = SpareRoom {
        nodes: more(header.node_room, header.node_count),
        references: more(header.reference_room, header.reference_count),
        records: header.record_room - header.active,
    };
    *merged = Merged::new(still.with_room(room)?, costs);
    Ok(())
}

/// Attempts to merge, each with twice the room of the one before.
const ATTEMPTS: u32 = 6;

impl Subject for OnHost<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        KD_TREE
    }

    fn timer(&self) -> &'static str {
        "wall"
    }

    fn traces_on_device(&self) -> bool {
        matches!(self.rays, KdRays::Device { .. })
    }

    fn place(&mut self, frame: &Frame<'_>) -> Result<()> {
        for part in &mut self.parts {
            part.mesh = frame.mesh(part.group);
        }
        self.rays.forget_trees();
        Ok(())
    }

    fn build(&mut self) -> Result<BuildRun> {
        let mut attempts = 0;
        let milliseconds = loop {
            let (milliseconds, built) = timed(|| self.build_once());
            attempts += 1;
            match (built, &mut self.trees) {
                (Ok(()), _) => break milliseconds,
                // The only argument that can be wrong here is the room.
                (Err(error), Trees::Merged(merged)) if error.is_argument() && attempts < ATTEMPTS => {
                    enlarge(merged, self.options.costs)?;
                }
                (Err(error), _) => return Err(error),
            }
        };
        self.bytes = self.trees.all()?.iter().map(|(tree, _)| tree.header.offsets().bytes).sum();
        Ok(BuildRun::whole(milliseconds))
    }

    fn memory(&self) -> MemoryRecord {
        MemoryRecord { structure_bytes: Some(self.bytes), ..MemoryRecord::default() }
    }

    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        Ok(match self.trees.all()?[..] {
            [(tree, _)] => Some(Cow::Borrowed(tree)),
            _ => None,
        })
    }

    fn set_rays(&mut self, new: &[Ray]) -> Result<()> {
        self.rays.set(&self.trees.all()?, new)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        self.rays.trace(&self.trees.all()?, query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        self.rays.work(&self.trees.all()?, query)
    }
}
