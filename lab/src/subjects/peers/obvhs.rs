//! `obvhs-fastest`, `obvhs-fast`, `obvhs-medium`: the Rust crate that builds on the CPU (PLOC and reinsertion), with its own
//! traversal and triangle test on every core.
//!
//! The build time holds what a user waits for: the tree, and the triangles copied into its order.

use crate::measure::overlap::{self, Epo};
use crate::measure::record;
use crate::scene::Mesh;
use crate::subjects::host_build::on_cpu;
use crate::subjects::host_rays::{HostRays, timed};
use crate::subjects::{BuildRun, Subject};
use crate::{Error, Result};
use bytemuck::Zeroable;
use hedgerow::bvh::layout::{Bvh2, Child, Header, MAGIC, Node, Record, Triangle as OurTriangle};
use hedgerow::bvh::twin::quality;
use hedgerow::gpu::Phase;
use hedgerow::trace::{Hit, Query, Ray};
use obvhs::BvhBuildParams;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::bvh2::{Bvh2 as Tree, node::Bvh2Node};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use rayon::prelude::*;
use std::time::Duration;

/// How much time obvhs takes to build.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// PLOC with the least search distance, one triangle a leaf.
    Fastest,
    /// A little reinsertion, leaves of up to eight triangles.
    Fast,
    /// More of both.
    Medium,
}

impl Preset {
    /// The builder's name, and what obvhs takes for it.
    fn name_and_parameters(self) -> (&'static str, BvhBuildParams) {
        match self {
            Preset::Fastest => ("obvhs-fastest", BvhBuildParams::fastest_build()),
            Preset::Fast => ("obvhs-fast", BvhBuildParams::fast_build()),
            Preset::Medium => ("obvhs-medium", BvhBuildParams::medium_build()),
        }
    }
}

/// A scene in obvhs's binary tree.
pub struct Obvhs {
    name: &'static str,
    parameters: BvhBuildParams,
    triangles: Vec<Triangle>,
    tree: Tree,
    /// In the tree's order.
    ordered: Vec<RtTriangle>,
    rays: HostRays,
}

impl Obvhs {
    /// Takes the triangles of `mesh` over into obvhs's own type.
    ///
    /// # Errors
    /// More triangles than obvhs's indices hold.
    pub fn new(mesh: &Mesh, preset: Preset) -> Result<Obvhs> {
        if mesh.triangles.len() > i32::MAX as usize {
            let count = mesh.triangles.len();
            return Err(Error::Argument(format!("{count} triangles, obvhs builds of at most {}", i32::MAX)));
        }
        let triangle = |i| {
            let [v0, v1, v2] = mesh.corners(i).map(glam::Vec3A::from);
            Triangle { v0, v1, v2 }
        };
        let triangles = (0..mesh.triangles.len()).map(triangle).collect();
        let (name, parameters) = preset.name_and_parameters();
        let (tree, ordered, rays) = (Tree::default(), Vec::new(), HostRays::default());
        Ok(Obvhs { name, parameters, triangles, tree, ordered, rays })
    }

    /// The weights of a hit, which obvhs does not give (Möller, Trumbore 1997, in double precision).
    fn with_weights(&self, ray: &Ray, hit: Hit) -> Hit {
        if !hit.is_some() {
            return hit;
        }
        let triangle = &self.triangles[hit.primitive as usize];
        let [v0, v1, v2] = [triangle.v0, triangle.v1, triangle.v2].map(|v| glam::Vec3::from(v).as_dvec3());
        let [origin, direction] = [ray.origin, ray.direction].map(|v| glam::Vec3::from(v).as_dvec3());
        let (e1, e2) = (v1 - v0, v2 - v0);
        let across = direction.cross(e2);
        let from_v0 = origin - v0;
        let scale = 1.0 / e1.dot(across);
        let (u, v) = (from_v0.dot(across) * scale, direction.dot(from_v0.cross(e1)) * scale);
        Hit { u: u as f32, v: v as f32, ..hit }
    }
}

/// The nearest or any hit of a ray by obvhs's traversal.
fn trace_one(tree: &Tree, ordered: &[RtTriangle], ray: &Ray, query: Query) -> Hit {
    let walked = obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max);
    let mut met = RayHit::none();
    match query {
        Query::ClosestHit => {
            tree.ray_traverse(walked, &mut met, |ray, i| ordered[i].intersect(ray));
        }
        Query::AnyHit => {
            tree.ray_traverse_miss(walked, |ray, i| {
                let t = ordered[i].intersect(ray);
                if t < ray.tmax {
                    met = RayHit { t: 0.0, primitive_id: i as u32, ..met };
                }
                t
            });
        }
    }
    if met.primitive_id == obvhs::ray::INVALID_ID {
        return Hit::NONE;
    }
    Hit { t: met.t, primitive: tree.primitive_indices[met.primitive_id as usize], u: 0.0, v: 0.0 }
}

/// obvhs's tree in our layout: its children lie side by side behind their parent's index.
fn converted(tree: &Tree, triangles: &[Triangle]) -> Bvh2 {
    let child = |node: &Bvh2Node, index| Child {
        lo: node.aabb().min.to_array(),
        hi: node.aabb().max.to_array(),
        index: if node.is_leaf() { node.first_index } else { index },
        count: node.prim_count,
    };
    let mut header = Header { magic: MAGIC, kind: OurTriangle::KIND, ..Header::zeroed() };
    let Some(root) = tree.nodes.first() else {
        return Bvh2 { header, nodes: Vec::new(), records: Vec::new(), geometries: Vec::new(), far: Vec::new() };
    };
    header.root = child(root, 0);
    header.active = tree.primitive_indices.len() as u32;
    header.primitive_count = header.active;
    let mut nodes = Vec::new();
    let mut inner = if root.is_leaf() { Vec::new() } else { vec![root.first_index] };
    let mut next = 0;
    // Breadth first: the slot of an inner node is the order in which it was put on the list.
    while let Some(&first) = inner.get(next) {
        next += 1;
        let children = [first, first + 1].map(|i| {
            let node = &tree.nodes[i as usize];
            let slot = inner.len() as u32;
            if !node.is_leaf() {
                inner.push(node.first_index);
            }
            child(node, slot)
        });
        nodes.push(Node { children });
    }
    header.inner_nodes = nodes.len() as u32;
    // A structure has a slot even where its root is a leaf.
    header.node_slots = header.inner_nodes.max(1);
    nodes.resize(header.node_slots as usize, Node::UNUSED);
    let record = |&primitive: &u32| {
        let Triangle { v0, v1, v2 } = &triangles[primitive as usize];
        let [v0, v1, v2] = [v0, v1, v2].map(|v| v.to_array());
        OurTriangle { v0, v1, v2, primitive }
    };
    let records = tree.primitive_indices.iter().map(record).collect();
    Bvh2 { header, nodes, records, geometries: Vec::new(), far: Vec::new() }
}

impl Subject for Obvhs {
    fn builder(&self) -> &str {
        self.name
    }

    fn kind(&self) -> &'static str {
        "host"
    }

    fn build(&mut self) -> Result<BuildRun> {
        let ((), run) = on_cpu(rayon::current_num_threads() as u32, || {
            let (building, tree) =
                timed(|| build_bvh2_from_tris(&self.triangles, self.parameters, &mut Duration::default()));
            self.tree = tree;
            let triangle = |&i: &u32| RtTriangle::from(&self.triangles[i as usize]);
            let (ordering, ()) = timed(|| {
                self.tree.primitive_indices.par_iter().map(triangle).collect_into_vec(&mut self.ordered);
            });
            let phases = [("build", building), ("triangles", ordering)];
            ((), BuildRun::of(phases.map(|(name, milliseconds)| Phase { name, milliseconds }).to_vec()))
        });
        Ok(run)
    }

    fn memory(&self) -> record::MemoryRecord {
        let bytes = size_of_val(&self.tree.nodes[..])
            + size_of_val(&self.tree.primitive_indices[..])
            + size_of_val(&self.ordered[..]);
        record::MemoryRecord { structure_bytes: Some(bytes as u64), ..Default::default() }
    }

    fn quality(&mut self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        Ok(record::QualityRecord::of(&quality::of(&converted(&self.tree, &self.triangles), c_t, c_i), c_t, c_i))
    }

    fn epo(&mut self, c_t: f64, c_i: f64, epo: Epo) -> Result<Option<f64>> {
        Ok(overlap::on_host(&converted(&self.tree, &self.triangles), c_t, c_i, epo))
    }

    fn tree(&mut self) -> Result<Option<Bvh2>> {
        Ok(Some(converted(&self.tree, &self.triangles)))
    }

    fn validate(&mut self) -> Result<()> {
        // The peer's own tracer walks the peer's own layout: rules of ours bind it only where our tracer takes over.
        Ok(())
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays.set(rays);
        Ok(())
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        let Obvhs { tree, ordered, rays, .. } = self;
        Ok(rays.trace(|ray| trace_one(tree, ordered, ray, query)))
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.rays.met().map(|(ray, &hit)| self.with_weights(ray, hit)).collect())
    }
}
