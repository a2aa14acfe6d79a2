//! `embree-low-tree`, `embree-medium-tree`, `embree-high-tree`: trees that Embree builds (`rtcBuildBVH`, two children a node), in
//! our layout. The host's tracer walks them, so that they compare with ours by nothing but the tree.
//!
//! A build has three phases. `boxes` writes the boxes of the triangles as Embree takes them, `build` is `rtcBuildBVH` alone, and
//! `convert` writes its nodes and leaves as ours, depth first, by one thread.

use super::embree::{Preset, failed};
use crate::Result;
use crate::measure::heap;
use crate::scene::Mesh;
use crate::subjects::BuildRun;
use crate::subjects::host_rays::timed;
use embree3::{
    Allocator, Bounds, BuildConfig, BuildPrimitive, Bvh, BvhBuilder, BvhNode, BvhResult, ChildBounds, Children, Config,
    Device, NodePtr,
};
use hedgerow::bvh::layout::{Bvh2, Child, Header, MAGIC, MAX_DEPTH, Node, Record, Triangle, status};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::split::{halves, padded};
use hedgerow::geometry::Aabb;
use hedgerow::gpu::Phase;
use rayon::prelude::*;
use std::time::Instant;

/// Triangles in a leaf at most: as many as make a leaf as large as one of our nodes.
const LEAF: usize = 8;

/// Embree's builder, and room for what it is given.
pub struct EmbreeTrees {
    preset: Preset,
    threads: u32,
    bvh: Bvh,
    primitives: Vec<BuildPrimitive>,
}

impl EmbreeTrees {
    /// With as many threads as all builders share.
    ///
    /// # Errors
    /// Embree cannot start.
    pub fn new(preset: Preset) -> Result<EmbreeTrees> {
        let threads = rayon::current_num_threads() as u32;
        let config = Config { threads, start_threads: true, ..Config::default() };
        let device = Device::with_config(config).map_err(failed("rtcNewDevice"))?;
        device.set_memory_monitor_function(|change, _| {
            heap::count(change);
            true
        });
        let bvh = device.create_bvh().map_err(failed("rtcNewBVH"))?;
        Ok(EmbreeTrees { preset, threads, bvh, primitives: Vec::new() })
    }

    /// Threads that Embree builds by.
    pub fn threads(&self) -> u32 {
        self.threads
    }

    /// The tree of `mesh`. Triangles that are not finite or name vertices that are not there are left out.
    ///
    /// # Errors
    /// Embree refuses the scene or has too little memory.
    pub fn build(&mut self, mesh: &Mesh) -> Result<(Bvh2, BuildRun)> {
        let is_split = self.preset == Preset::High;
        let (boxes_ms, status) = timed(|| self.read(mesh, is_split));
        let (mut tree, [build_ms, convert_ms]) = match is_split {
            false => self.built::<false>(mesh)?,
            true => self.built::<true>(mesh)?,
        };
        tree.header.status = status;
        if is_split {
            tree.header.split_from = mesh.triangles.len() as u32;
        }
        let phases = [("boxes", boxes_ms), ("build", build_ms), ("convert", convert_ms)];
        Ok((tree, BuildRun::of(phases.map(|(name, milliseconds)| Phase { name, milliseconds }).to_vec())))
    }

    /// The tree over the boxes that were read, and the milliseconds of Embree's part and of ours.
    fn built<const SPLIT: bool>(&mut self, mesh: &Mesh) -> Result<(Bvh2, [f64; 2])> {
        let config = BuildConfig {
            quality: self.preset.quality(),
            max_branching_factor: 2,
            max_depth: MAX_DEPTH,
            max_leaf_size: LEAF as u32,
            traversal_cost: Collapse::SAH.c_t,
            intersection_cost: Collapse::SAH.c_i,
            ..BuildConfig::default()
        };
        let start = Instant::now();
        let built = self.bvh.build_scoped(&config, &mut self.primitives, &Triangles::<SPLIT>(mesh), |built| {
            let building = start.elapsed().as_secs_f64() * 1e3;
            let (converting, tree) = timed(|| converted(&built, mesh));
            (tree, [building, converting])
        });
        built.map_err(failed("rtcBuildBVH"))
    }

    /// Writes the boxes of all triangles, with room for as many again where they may be split. The status says what was left out.
    fn read(&mut self, mesh: &Mesh, is_split: bool) -> u32 {
        let primitive = |primitive: usize| {
            let corners = corners(mesh, primitive as u32)?;
            let is_finite = corners.iter().flatten().all(|x| x.is_finite());
            if is_finite { Ok(embree_box(&Aabb::around(&corners), primitive as u32)) } else { Err(status::NON_FINITE) }
        };
        let count = mesh.triangles.len();
        self.primitives.clear();
        self.primitives.reserve_exact(if is_split { 2 * count } else { count });
        let unread = embree_box(&Aabb::EMPTY, u32::MAX);
        self.primitives.resize(count, unread);
        let read = |(i, place): (usize, &mut BuildPrimitive)| match primitive(i) {
            Ok(primitive) => {
                *place = primitive;
                0
            }
            Err(reason) => reason,
        };
        let status = self.primitives.par_iter_mut().enumerate().map(read).reduce(|| 0, |a, b| a | b);
        self.primitives.retain(|primitive| primitive.primID != u32::MAX);
        status
    }
}

/// The corners of a triangle, without negative zeros.
fn corners(mesh: &Mesh, primitive: u32) -> Result<[[f32; 3]; 3], u32> {
    let corners = mesh.triangles[primitive as usize].map(|v| mesh.positions.get(v as usize));
    let [Some(v0), Some(v1), Some(v2)] = corners else { return Err(status::INDEX_OUT_OF_RANGE) };
    Ok([v0, v1, v2].map(|v| v.map(|x| x + 0.0)))
}

fn embree_box(&Aabb { lo, hi }: &Aabb, primitive: u32) -> BuildPrimitive {
    let ([lower_x, lower_y, lower_z], [upper_x, upper_y, upper_z]) = (lo, hi);
    BuildPrimitive { lower_x, lower_y, lower_z, geomID: 0, upper_x, upper_y, upper_z, primID: primitive }
}

fn box_of(part: &BuildPrimitive) -> Aabb {
    Aabb { lo: [part.lower_x, part.lower_y, part.lower_z], hi: [part.upper_x, part.upper_y, part.upper_z] }
}

fn bounds_of(&Aabb { lo, hi }: &Aabb) -> Bounds {
    let ([lower_x, lower_y, lower_z], [upper_x, upper_y, upper_z]) = (lo, hi);
    Bounds { lower_x, lower_y, lower_z, align0: 0.0, upper_x, upper_y, upper_z, align1: 0.0 }
}

/// A node in Embree's memory. Boxes of inner nodes are not kept: converting takes them from those of the leaves.
#[derive(Clone, Copy)]
enum Built<'id> {
    Inner([Option<NodePtr<'id, Built<'id>>>; 2]),
    Leaf { bounds: Aabb, count: u32, primitives: [u32; LEAF] },
}

// SAFETY: plain data and handles of the same build; it owns nothing, and its layout does not depend on the lifetime.
unsafe impl BvhNode for Built<'_> {}

/// What Embree calls while it builds; with `SPLIT` also to split a triangle.
struct Triangles<'m, const SPLIT: bool>(&'m Mesh);

impl<const SPLIT: bool> Triangles<'_, SPLIT> {
    fn corners(&self, primitive: u32) -> [[f32; 3]; 3] {
        corners(self.0, primitive).expect("Embree was given triangles that have corners")
    }

    /// The box of a part in a leaf: a little larger where it is not the whole triangle's, so that no ray is lost between it and
    /// the next (`hedgerow::bvh::twin::split`).
    fn kept(&self, part: &BuildPrimitive) -> Aabb {
        let bounds = box_of(part);
        if !SPLIT {
            return bounds;
        }
        let whole = Aabb::around(&self.corners(part.primID));
        if bounds == whole { whole } else { padded(&bounds, &whole) }
    }
}

impl<const SPLIT: bool> BvhBuilder for Triangles<'_, SPLIT> {
    type Node<'id> = Built<'id>;
    const MAX_CHILDREN: usize = 2;
    const SPATIAL_SPLITS: bool = SPLIT;

    fn create_node<'id>(&self, memory: &Allocator<'id>, _count: usize) -> &'id mut Built<'id> {
        memory.alloc(Built::Inner([None; 2]))
    }

    fn set_children<'id>(&self, node: &mut Built<'id>, of_embree: Children<'id, Built<'id>>) {
        if let Built::Inner(children) = node {
            *children = [of_embree.get(0), of_embree.get(1)];
        }
    }

    fn set_bounds<'id>(&self, _node: &mut Built<'id>, _bounds: ChildBounds<'_>) {}

    fn create_leaf<'id>(&self, memory: &Allocator<'id>, parts: &[BuildPrimitive]) -> &'id mut Built<'id> {
        let bounds = parts.iter().fold(Aabb::EMPTY, |bounds, part| bounds.union(&self.kept(part)));
        let mut primitives = [0; LEAF];
        for (place, part) in primitives.iter_mut().zip(parts) {
            *place = part.primID;
        }
        memory.alloc(Built::Leaf { bounds, count: parts.len() as u32, primitives })
    }

    fn split(&self, part: &BuildPrimitive, axis: u32, at: f32) -> (Bounds, Bounds) {
        let (bounds, axis) = (box_of(part), axis as usize);
        let [mut below, mut above] = halves(&self.corners(part.primID), &bounds, axis, at);
        // The box of a part is larger than the part, so that a side may have nothing; Embree wants boxes all the same.
        let is_empty = |half: &Aabb| (0..3).any(|i| half.lo[i] > half.hi[i]);
        if is_empty(&below) || is_empty(&above) {
            (below, above) = (bounds, bounds);
            (below.hi[axis], above.lo[axis]) = (at, at);
        }
        (bounds_of(&below), bounds_of(&above))
    }
}

/// Writes Embree's nodes as ours.
struct Conversion<'b, 'id, 'm, const SPLIT: bool> {
    built: &'b BvhResult<'id, Triangles<'m, SPLIT>>,
    mesh: &'m Mesh,
    nodes: Vec<Node>,
    records: Vec<Triangle>,
}

fn converted<'m, const SPLIT: bool>(built: &BvhResult<'_, Triangles<'m, SPLIT>>, mesh: &'m Mesh) -> Bvh2 {
    let mut header = Header { magic: MAGIC, kind: Triangle::KIND, geometry_count: 1, ..bytemuck::Zeroable::zeroed() };
    let count = mesh.triangles.len();
    let (nodes, records) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut conversion = Conversion { built, mesh, nodes, records };
    header.root = match built.root() {
        Some(root) => conversion.child(root),
        None => Child { lo: Aabb::EMPTY.lo, index: 0, hi: Aabb::EMPTY.hi, count: 0 },
    };
    let Conversion { mut nodes, records, .. } = conversion;
    header.inner_nodes = nodes.len() as u32;
    if nodes.is_empty() {
        nodes.push(Node::UNUSED);
    }
    header.active = records.len() as u32;
    header.primitive_count = header.active;
    header.node_slots = nodes.len() as u32;
    Bvh2 { header, nodes, records, geometries: Vec::new(), far: Vec::new() }
}

impl<'id, const SPLIT: bool> Conversion<'_, 'id, '_, SPLIT> {
    /// Writes a subtree, and gives what names it.
    fn child(&mut self, node: &Built<'id>) -> Child {
        match *node {
            Built::Inner(children) => {
                let slot = self.nodes.len();
                self.nodes.push(Node::UNUSED);
                let built = self.built;
                let children = children.map(|child| self.child(built.resolve(child.expect("Embree has set both"))));
                self.nodes[slot] = Node { children };
                let Aabb { lo, hi } = children[0].bounds().union(&children[1].bounds());
                Child { lo, index: slot as u32, hi, count: 0 }
            }
            Built::Leaf { bounds: Aabb { lo, hi }, count, mut primitives } => {
                // Two parts of a triangle may have come together again.
                let primitives = &mut primitives[..count as usize];
                primitives.sort_unstable();
                let first = self.records.len() as u32;
                for of_one in primitives.chunk_by(|a, b| a == b) {
                    let [v0, v1, v2] = corners(self.mesh, of_one[0]).expect("what Embree was given has corners");
                    self.records.push(Triangle { v0, v1, v2, primitive: of_one[0] });
                }
                Child { lo, index: first, hi, count: self.records.len() as u32 - first }
            }
        }
    }
}
