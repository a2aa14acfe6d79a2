//! Kd-trees that the host builds every frame, or merges into the static one.

use super::AnimationMethod;
use super::on_device::static_tree;
use crate::device::Device;
use crate::measure::record::MemoryRecord;
use crate::scene::{Frame, Group, Mesh};
use crate::subjects::builders::Spec;
use crate::subjects::host_rays::{KdRays, Numbered, timed};
use crate::subjects::kd_device::KdDevice;
use crate::subjects::{BuildRun, KD_TREE, Subject};
use crate::{Error, Result};
use hedgerow::kdtree::layout::{KdTree, SpareRoom};
use hedgerow::trace::kd::Traversal;
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
enum Trees {
    /// The tree of what stands still, and one a part.
    Apart { still: Option<Box<KdTree>>, parts: Vec<KdTree> },
    /// One, which the parts are merged into.
    Merged(Box<Merged>),
}

impl Trees {
    /// Each with the number of its first primitive.
    fn all<'t>(&'t mut self, parts: &[Part]) -> Result<Vec<Numbered<'t>>> {
        Ok(match self {
            Trees::Apart { still, parts: trees } => {
                let firsts = parts.iter().map(|part| part.first);
                still.iter().map(|still| (&**still, 0)).chain(trees.iter().zip(firsts)).collect()
            }
            Trees::Merged(merged) => vec![(merged.tree()?, 0)],
        })
    }
}

impl<'a> OnHost<'a> {
    /// The trees of a way, in the first frame; that of what stands still by the options that stand second. Where `builder` is that
    /// of the device, its twin builds here and the device traces.
    ///
    /// # Errors
    /// Too little memory; there is no device to trace on; nothing stands still that could be merged into.
    pub fn new(
        way: AnimationMethod,
        device: Option<&'a Device>,
        builder: &Spec,
        (options, traversal, traces_on_device): (HostKdOptions, Traversal, bool),
        static_options: &HostKdOptions,
        first: &Frame<'_>,
    ) -> Result<OnHost<'a>> {
        let groups = match way {
            AnimationMethod::Rebuild => vec![Group::Whole],
            AnimationMethod::TwoTrees => vec![Group::Moving],
            _ => Group::objects(first),
        };
        let part = |group: Group| {
            let name = match group {
                Group::Object(k) => format!("{k}: {}", first.dynamic.objects[k].name),
                _ => String::new(),
            };
            Part { group, name, first: first.first(group), mesh: Mesh::default() }
        };
        let still = match way {
            AnimationMethod::Rebuild => None,
            _ => static_tree(&first.dynamic.static_mesh, static_options)?,
        };
        let trees = match way {
            AnimationMethod::Merge => {
                let name = &first.dynamic.name;
                let still = still.ok_or_else(|| {
                    Error::Scene(format!("{name}: nothing in it stands still, so there is nothing to merge into"))
                })?;
                let moving: usize = first.dynamic.objects.iter().map(|object| object.triangles.len()).sum();
                let moving = moving as u32;
                let each = moving.saturating_mul(ROOM_EACH).saturating_add(ROOM_AT_LEAST);
                let still = still.with_room(SpareRoom { nodes: each, references: each, records: moving })?;
                Trees::Merged(Box::new(Merged::new(still, options.costs)))
            }
            _ => Trees::Apart { still: still.map(Box::new), parts: Vec::new() },
        };
        let rays = match (traces_on_device, device) {
            (false, _) => KdRays::on_host(traversal),
            (true, Some(device)) => KdRays::on_device(KdDevice::new(device, traversal)?),
            (true, None) => return Err(Error::NoVulkan("rays are traced on a device, and none was opened".into())),
        };
        Ok(OnHost {
            builder: builder.to_string(),
            options,
            parts: groups.into_iter().map(part).collect(),
            trees,
            rays,
            bytes: 0,
        })
    }

    fn build_once(&mut self) -> Result<()> {
        if let Trees::Merged(merged) = &mut self.trees {
            merged.restore();
        }
        let tree = |part: &Part| build(&part.mesh.positions, &part.mesh.triangles, &self.options);
        let built: Vec<KdTree> = self.parts.par_iter().map(tree).collect::<hedgerow::Result<_>>()?;
        match &mut self.trees {
            Trees::Apart { parts, .. } => *parts = built,
            Trees::Merged(merged) => {
                for (part, tree) in self.parts.iter().zip(built) {
                    merged.insert(&part.name, part.first, tree)?;
                }
                merged.tree()?;
            }
        }
        Ok(())
    }

    /// Twice the room for what is merged, if that helps.
    fn enlarge(&mut self) -> Result<()> {
        if let Trees::Merged(merged) = &mut self.trees {
            let still = merged.restore().clone();
            let header = &still.header;
            let more = |room: u32, count: u32| (room - count).max(ROOM_AT_LEAST).saturating_mul(2);
            let room = SpareRoom {
                nodes: more(header.node_room, header.node_count),
                references: more(header.reference_room, header.reference_count),
                records: header.record_room - header.active,
            };
            **merged = Merged::new(still.with_room(room)?, self.options.costs);
        }
        Ok(())
    }
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
        let mut attempts = 1;
        loop {
            let (milliseconds, built) = timed(|| self.build_once());
            match built {
                Ok(()) => {
                    let trees = self.trees.all(&self.parts)?;
                    self.bytes = trees.iter().map(|(tree, _)| tree.header.offsets().bytes).sum();
                    return Ok(BuildRun::whole(milliseconds));
                }
                // The only argument that can be wrong here is the room.
                Err(Error::Argument(_)) if attempts < ATTEMPTS && matches!(self.trees, Trees::Merged(_)) => {
                    self.enlarge()?;
                }
                Err(error) => return Err(error),
            }
            attempts += 1;
        }
    }

    fn memory(&self) -> MemoryRecord {
        MemoryRecord { structure_bytes: Some(self.bytes), ..MemoryRecord::default() }
    }

    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        Ok(match self.trees.all(&self.parts)?[..] {
            [(tree, _)] => Some(Cow::Borrowed(tree)),
            _ => None,
        })
    }

    fn set_rays(&mut self, new: &[Ray]) -> Result<()> {
        self.rays.set(&self.trees.all(&self.parts)?, new)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        self.rays.trace(&self.trees.all(&self.parts)?, query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        self.rays.work(&self.trees.all(&self.parts)?, query)
    }
}
