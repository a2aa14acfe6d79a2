//! Kd-trees that the host builds every frame, or merges into the static one.

use super::contender::Group;
use super::on_device::static_tree;
use super::{Contender, Frame, Way};
use crate::device::{Buffer, Device};
use crate::measure::record::Memory;
use crate::scene::Mesh;
use crate::subjects::builders::Spec;
use crate::subjects::host::timed;
use crate::subjects::kd_device::KdDevice;
use crate::{Error, Result};
use hedgerow::kdtree::layout::{KdTree, Room};
use hedgerow::kdtree::quality;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd::trace;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_host::kdtree::merge::Merged;
use hedgerow_host::kdtree::{Options, build};
use rayon::prelude::*;

/// Room for merging, for each triangle that moves: what scenes that were measured need, twice over; and for those with few. More
/// is made where it is too little.
const ROOM_EACH: u32 = 24;
const ROOM_AT_LEAST: u32 = 1 << 16;

/// Trees on the host, traced one after the other there or on the device.
pub struct OnHost<'a> {
    builder: String,
    options: Options,
    parts: Vec<Part>,
    trees: Trees,
    tracing: Tracing<'a>,
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
    fn all<'t>(&'t mut self, parts: &[Part]) -> Result<Vec<(&'t KdTree, u32)>> {
        Ok(match self {
            Trees::Apart { still, parts: trees } => {
                let firsts = parts.iter().map(|part| part.first);
                still.iter().map(|still| (&**still, 0)).chain(trees.iter().zip(firsts)).collect()
            }
            Trees::Merged(merged) => vec![(merged.tree()?, 0)],
        })
    }
}

/// Where rays are traced, and what for.
enum Tracing<'a> {
    Host { traversal: Traversal, rays: Vec<Ray>, hits: Vec<Hit> },
    Device { tracer: Box<KdDevice<'a>>, uploaded: Vec<(Buffer<'a>, u32)> },
}

impl<'a> OnHost<'a> {
    /// The trees of a way, in the first frame; that of what stands still by the options that stand second. Where `builder` is that
    /// of the device, its twin builds here and the device traces.
    ///
    /// # Errors
    /// Too little memory; there is no device to trace on; nothing stands still that could be merged into.
    pub fn new(
        way: Way,
        device: Option<&'a Device>,
        builder: &Spec,
        (options, traversal, traces_on_device): (Options, Traversal, bool),
        static_options: &Options,
        first: &Frame<'_>,
    ) -> Result<OnHost<'a>> {
        let groups = match way {
            Way::Rebuild => vec![Group::Whole],
            Way::TwoTrees => vec![Group::Moving],
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
            Way::Rebuild => None,
            _ => static_tree(&first.dynamic.static_mesh, static_options)?,
        };
        let trees = match way {
            Way::Merge => {
                let name = &first.dynamic.name;
                let still = still.ok_or_else(|| {
                    Error::Scene(format!("{name}: nothing in it stands still, so there is nothing to merge into"))
                })?;
                let moving: usize = first.dynamic.objects.iter().map(|object| object.triangles.len()).sum();
                let moving = moving as u32;
                let each = moving.saturating_mul(ROOM_EACH).saturating_add(ROOM_AT_LEAST);
                let still = still.with_room(Room { nodes: each, references: each, records: moving })?;
                Trees::Merged(Box::new(Merged::new(still, options.costs)))
            }
            _ => Trees::Apart { still: still.map(Box::new), parts: Vec::new() },
        };
        let tracing = match (traces_on_device, device) {
            (false, _) => Tracing::Host { traversal, rays: Vec::new(), hits: Vec::new() },
            (true, Some(device)) => {
                Tracing::Device { tracer: Box::new(KdDevice::new(device, traversal)?), uploaded: Vec::new() }
            }
            (true, None) => return Err(Error::NoVulkan("rays are traced on a device, and none was opened".into())),
        };
        Ok(OnHost {
            builder: builder.to_string(),
            options,
            parts: groups.into_iter().map(part).collect(),
            trees,
            tracing,
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
            let room = Room {
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

/// The nearest hit in all trees, of equally near ones that in the earlier; or any.
fn through(trees: &[(&KdTree, u32)], ray: &Ray, query: Query, traversal: Traversal) -> (Hit, Work) {
    let (mut nearest, mut work, mut ray) = (Hit::NONE, Work::default(), *ray);
    for &(tree, first) in trees {
        let (hit, more) = trace(tree, &ray, query, traversal);
        work =
            Work { steps: work.steps + more.steps, tests: work.tests + more.tests, leaves: work.leaves + more.leaves };
        if hit.is_some() {
            nearest = Hit { primitive: hit.primitive + first, ..hit };
            if query == Query::AnyHit {
                break;
            }
            ray.t_max = hit.t;
        }
    }
    (nearest, work)
}

impl Contender for OnHost<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn timer(&self) -> &'static str {
        "wall"
    }

    fn place(&mut self, frame: &Frame<'_>) -> Result<()> {
        for part in &mut self.parts {
            part.mesh = frame.mesh(part.group);
        }
        if let Tracing::Device { uploaded, .. } = &mut self.tracing {
            uploaded.clear();
        }
        Ok(())
    }

    fn build(&mut self) -> Result<f64> {
        let mut attempts = 1;
        loop {
            let (milliseconds, built) = timed(|| self.build_once());
            match built {
                Ok(()) => return Ok(milliseconds),
                // The only argument that can be wrong here is the room.
                Err(Error::Argument(_)) if attempts < ATTEMPTS && matches!(self.trees, Trees::Merged(_)) => {
                    self.enlarge()?;
                }
                Err(error) => return Err(error),
            }
            attempts += 1;
        }
    }

    fn memory(&mut self) -> Result<Memory> {
        let trees = self.trees.all(&self.parts)?;
        let structure_bytes = Some(trees.iter().map(|(tree, _)| tree.header.sizes().bytes).sum());
        Ok(Memory { structure_bytes, ..Memory::default() })
    }

    fn sah(&mut self, c_t: f64, c_i: f64) -> Result<Option<f64>> {
        Ok(match self.trees.all(&self.parts)?[..] {
            [(tree, _)] => Some(quality::on_host(tree, c_t, c_i).sah),
            _ => None,
        })
    }

    fn set_rays(&mut self, new: &[Ray]) -> Result<()> {
        match &mut self.tracing {
            Tracing::Host { rays, .. } => *rays = new.to_vec(),
            Tracing::Device { tracer, uploaded } => {
                if uploaded.is_empty() {
                    for (tree, first) in self.trees.all(&self.parts)? {
                        uploaded.push((tracer.upload(tree)?, first));
                    }
                }
                tracer.set_rays(new)?;
            }
        }
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        match &mut self.tracing {
            Tracing::Host { traversal, rays, hits } => {
                let trees = self.trees.all(&self.parts)?;
                let (milliseconds, all) =
                    timed(|| rays.par_iter().map(|ray| through(&trees, ray, query, *traversal).0).collect());
                *hits = all;
                Ok(milliseconds)
            }
            Tracing::Device { tracer, uploaded } => tracer.trace_several(&addresses(uploaded), query),
        }
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(match &self.tracing {
            Tracing::Host { hits, .. } => hits.clone(),
            Tracing::Device { tracer, .. } => tracer.hits(),
        })
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        match &self.tracing {
            Tracing::Host { traversal, rays, .. } => {
                let trees = self.trees.all(&self.parts)?;
                Ok(Some(rays.par_iter().map(|ray| through(&trees, ray, query, *traversal).1).collect()))
            }
            Tracing::Device { tracer, uploaded } => tracer.work_several(&addresses(uploaded), query),
        }
    }
}

fn addresses(uploaded: &[(Buffer<'_>, u32)]) -> Vec<(u64, u32)> {
    uploaded.iter().map(|(tree, first)| (tree.address(), *first)).collect()
}
