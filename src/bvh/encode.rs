//! From primitives to an order: bounds, codes and sort, which every builder begins with.
//!
//! `glsl/bvh/encode.glsl` is the device's side.

use super::child_order::ChildOrder;
use super::codes::Codes;
use super::geometry::{Geometry, Input, Planned, Primitives};
use super::sah::Collapse;
use super::scratch::BuildPhase;
use super::split::Split;
use crate::Result;
use crate::geometry::Aabb;
use crate::gpu::arguments;
use crate::gpu::plan::Plan;
use crate::gpu::radix_sort::{self, SortShape};
use crate::gpu::{Kernel, Step, shaders};

/// The phases up to the sort, for one device, codes and number of primitives.
#[derive(Debug, Clone)]
pub(super) struct Encode {
    pub codes: Codes,
    /// The most bits of codes, where the device takes as many as the primitives' spread needs.
    pub bits_up_to: Option<u32>,
    pub collapse: Collapse,
    /// The order that children get in the hierarchy.
    pub child_order: Option<ChildOrder>,
    pub shape: SortShape,
    /// Items of an invocation in a task.
    pub items: u32,
    /// The same where a dispatch of its own finds the bounds.
    pub bounds_items: u32,
    /// Whether climbs meet in the workgroup first.
    pub meets_in_group: bool,
    /// Workgroups that share what only the device knows the number of.
    pub sharers: u32,
    /// Bytes of shared memory of a workgroup that a method may take beside the sort.
    pub shared_left: u32,
    /// What the tree is over: primitives, or references to split ones.
    pub count: u32,
    /// What makes those references.
    pub split: Option<Split>,
    pub primitives: Primitives,
    pub geometry_count: u32,
    pub build_flags: u32,
    /// Whether one workgroup does everything.
    pub alone: bool,
    /// Whether two triangles that share an edge may be one leaf from the start (glsl/bvh/pairs.glsl). A tile has whole blocks of them.
    pub pairs: bool,
    /// Whether the structure has the primitives' numbers in place of their records.
    pub numbered: bool,
    /// Whether the clusters of a method lie where the records will.
    pub clusters_in_records: bool,
}

impl arguments::Build {
    /// The same for a tree that is not collapsed.
    pub fn without_collapse(&self) -> arguments::Build {
        arguments::Build { collapses: 0, ..*self }
    }

    /// The address of what is left out of the sort, passes and keys: the state's last two words.
    fn left_out(&self) -> u64 {
        self.scratch + arguments::BUILD_STATE_BYTES - 8
    }

    /// The address of the box that most primitives are in, where codes have sections: before that.
    pub fn where_most_is(&self) -> u64 {
        self.left_out() - size_of::<Aabb>() as u64
    }

    /// The address of a part of the scratch memory.
    pub fn part(&self, at: u32) -> u64 {
        self.scratch + Plan::<BuildPhase>::UNIT * u64::from(at)
    }
}

/// In `SOURCE_WORD` of geometry.glsl: leaves hold references.
const HAS_REFERENCES: u32 = 8;
/// There: the structure has numbers in place of records.
const HAS_NUMBERS: u32 = 16;
/// There: two triangles may be one leaf from the start.
const HAS_PAIRS: u32 = 64;
/// There: clusters lie where records will.
const CLUSTERS_IN_RECORDS: u32 = 32;
/// In glsl/bvh/build_state.glsl: triangles among which pairs are found.
pub(super) const PAIR_BLOCK: u32 = 8;

impl Encode {
    /// Bits that there is room and time for.
    fn most_bits(&self) -> u32 {
        self.bits_up_to.map_or(self.codes.bits, |most| self.codes.most_by_spread(most))
    }

    pub fn key_words(&self) -> u32 {
        if self.most_bits() > 32 { 2 } else { 1 }
    }

    /// What kernels are told of the codes.
    pub fn code_kind(&self) -> u32 {
        self.codes.kind_word() | if self.bits_up_to.is_some() { Codes::BY_SPREAD } else { 0 }
    }

    /// Words of the sort's table, in which the codes' prefixes lie before the sort. One workgroup on a CPU gives each of its
    /// lanes a strip.
    pub fn table_words(&self) -> u64 {
        let sort = if self.alone && self.shape.private_counters {
            (1 << self.shape.digit_bits) * u64::from(self.shape.workgroup + 1)
        } else {
            self.shape.table_words(self.count)
        };
        sort.max(self.codes.prefix_words())
    }

    pub fn passes(&self) -> u32 {
        if self.count < 2 { 0 } else { self.shape.passes(self.most_bits()) }
    }

    /// Workgroups of the phases that go over all primitives.
    pub fn tiles(&self) -> u32 {
        self.tiles_of(self.count)
    }

    /// Workgroups of a phase over this many items.
    pub fn tiles_of(&self, count: u32) -> u32 {
        count.div_ceil(self.shape.workgroup * self.items)
    }

    /// Workgroups that share the tiles, where only the device knows how many have something to do.
    pub fn shared_tiles(&self) -> u32 {
        self.tiles().min(self.sharers)
    }

    /// Specialisation constants 1 to 4 of every kernel.
    fn constants(&self) -> [u32; 4] {
        self.shape.constants(self.items | u32::from(self.meets_in_group) << 16, self.key_words())
    }

    fn pairs_constant(&self) -> u32 {
        if self.pairs { HAS_PAIRS } else { 0 }
    }

    /// A kernel that reads no primitives.
    pub fn kernel(&self, shader: &'static shaders::Shader) -> Kernel {
        Kernel::new(shader, self.shape.workgroup, &[&self.constants()[..], &[self.pairs_constant()]].concat())
    }

    /// A kernel that reads primitives.
    pub fn reading_kernel(&self, shader: &'static shaders::Shader, input: &Input) -> Kernel {
        self.reading_kernel_with(shader, input, &[])
    }

    /// The same with specialisation constants from 7 on.
    pub fn reading_kernel_with(&self, shader: &'static shaders::Shader, input: &Input, more: &[u32]) -> Kernel {
        let constants = self.constants();
        let references = if self.split.is_some() { HAS_REFERENCES } else { 0 };
        let numbers = if self.numbered { HAS_NUMBERS } else { 0 };
        let clusters = if self.clusters_in_records { CLUSTERS_IN_RECORDS } else { 0 };
        let source = input.source_constant(self.primitives) | references | numbers | clusters | self.pairs_constant();
        let source = [source, self.codes.prefix_constant()];
        Kernel::new(shader, self.shape.workgroup, &[&constants[..], &source, more].concat())
    }

    /// A kernel that reads primitives and makes an LBVH of them.
    pub fn lbvh_kernel(&self, shader: &'static shaders::Shader, input: &Input) -> Kernel {
        self.reading_kernel_with(shader, input, &[self.child_order.map_or(0, ChildOrder::rule)])
    }

    /// A kernel that reads primitives before they are split.
    pub fn unsplit_kernel(&self, shader: &'static shaders::Shader, input: &Input) -> Kernel {
        let constants = self.constants();
        let source = [input.source_constant(self.primitives)];
        Kernel::new(shader, self.shape.workgroup, &[&constants[..], &source].concat())
    }

    /// The kernel of a `reset` shader.
    pub fn reset_kernel(&self, shader: &'static shaders::Shader) -> Kernel {
        let constants = self.constants();
        Kernel::new(shader, self.shape.workgroup, &[&constants[..], &[0, self.codes.prefix_constant()]].concat())
    }

    /// The same with the items that the bounds are found by.
    fn for_bounds(&self) -> Encode {
        Encode { items: self.bounds_items, ..self.clone() }
    }

    /// The input's geometry as the kernels are given it, and its formats.
    pub fn checked(&self, input: &Input) -> Result<(Geometry, u32)> {
        let primitive_count = self.split.map_or(self.count, |split| split.primitives);
        let planned = Planned { primitives: self.primitives, primitive_count, geometry_count: self.geometry_count };
        planned.check(input)?;
        self.split.map_or(Ok(()), |split| split.check(input))?;
        Ok(input.for_kernels())
    }

    /// What the kernels are given, with scratch memory of this plan at address `scratch`.
    pub fn arguments(
        &self,
        input: &Input,
        structure: u64,
        scratch: u64,
        parts: arguments::BuildParts,
    ) -> Result<arguments::Build> {
        let (geometry, formats) = self.checked(input)?;
        Ok(arguments::Build {
            vertices: geometry.vertices,
            indices: geometry.indices,
            transform: geometry.transform,
            structure,
            scratch,
            vertex_stride: geometry.vertex_stride,
            vertex_count: geometry.vertex_count,
            formats,
            primitive_count: self.count,
            code_kind: self.code_kind(),
            collapses: self.collapse.enabled.into(),
            build_flags: self.build_flags,
            c_t: self.collapse.c_t,
            c_i: self.collapse.c_i,
            column_keys: self.shape.column_keys(self.count),
            passes: self.passes(),
            level: 0,
            parts,
        })
    }

    /// The one dispatch that does what [`Encode::steps`] does, of a build by one workgroup. Label: `encode`.
    pub fn alone_step(&self, input: &Input, arguments: &arguments::Build) -> Step {
        let column_keys = match self.shape.private_counters {
            true => self.count.div_ceil(self.shape.workgroup).max(1),
            false => arguments.column_keys,
        };
        let arguments = arguments::Build { column_keys, ..*arguments };
        Step::new("encode", self.reading_kernel(&shaders::BVH_ENCODE_ALONE, input), &arguments, 1)
    }

    /// The dispatches up to the sort; what follows needs a barrier before. Labels: `bounds`, `encode`, `sort`, and for
    /// codes with a grid `cells`.
    pub fn steps(&self, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
        let reading =
            |of: &Encode, phase, shader, groups| Step::new(phase, of.reading_kernel(shader, input), arguments, groups);
        let sort = radix_sort::Sort { count: self.count, bits: self.most_bits(), identity: !self.pairs };
        let parts = arguments.parts;
        let buffers = radix_sort::SortBuffers {
            keys: parts.keys.map(|at| arguments.part(at)),
            values: parts.values.map(|at| arguments.part(at)),
            table: arguments.part(parts.table),
        };
        let bounds = self.for_bounds();
        // Blocks of pairs are counted by the tiles that they are found in.
        let tiled = if self.pairs { &bounds } else { self };
        // Where codes have sections it looks at a sample of the primitives.
        let reset = match self.codes.bounds {
            bounds if bounds.has_sections() => self.reading_kernel(&shaders::BVH_ENCODE_RESET, input),
            _ => self.reset_kernel(&shaders::BVH_ENCODE_RESET),
        };
        let mut steps = vec![
            Step::new("bounds", reset, arguments, 1),
            reading(&bounds, "bounds", &shaders::BVH_ENCODE_BOUNDS, bounds.tiles()),
            reading(tiled, "encode", &shaders::BVH_ENCODE_PLAN, 1),
        ];
        if self.codes.has_grid() {
            steps.push(reading(self, "cells", &shaders::BVH_ENCODE_CELLS, self.tiles()));
            steps.push(reading(self, "cells", &shaders::BVH_ENCODE_PREFIXES, 1));
        }
        steps.push(reading(tiled, "encode", &shaders::BVH_ENCODE_CODES, tiled.tiles()));
        let left_out = if self.bits_up_to.is_some() || self.pairs { arguments.left_out() } else { 0 };
        steps.extend(radix_sort::steps_but(&self.shape, &buffers, &sort, left_out));
        steps
    }
}
