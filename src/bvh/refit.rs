//! Refitting on the device: after its primitives have moved, a structure gets their new boxes, and keeps its tree.
//!
//! Bottom-up in one pass, of two siblings the second that is done goes on with their parent (Karras 2012). This is what Vulkan
//! calls an update, with the rules of `VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR`: vertices, indices, transforms, boxes
//! and instances may be others, but as many, of the same formats and flags, and in place. A primitive that was inactive at the
//! build stays so, whatever it is now.
//!
//! Where those rules are broken, nothing is: a primitive that can no longer be met (NaN, an index out of range) sets its bit of
//! the status, which stays, and is met by no ray until an update brings it back.
//!
//! [`Refit::scratch_bytes`] gives the memory, [`Refit::record`] records into the caller's command buffer. The structure may be
//! compacted, and its slots lie in any order: each record names its primitive, and each node its children. Nearness in memory
//! is worth time, however: an invocation refits a run of slots, and what lies in one needs no other.
//! [`Header::sah_growth`](super::layout::Header::sah_growth) says afterwards how much worse the tree has become, and so when to
//! build again. The twin is [`super::twin::refit`]: the same bytes.

use super::builder;
use super::far;
use super::geometry::Planned;
pub use super::geometry::{Geometry, Input, Primitives, Source};
use super::layout::{NODES_OFFSET, node_slots};
use super::sah::Collapse;
use crate::gpu::arguments;
use crate::gpu::{Context, Kernel, Recorder, Region, Step, radix_sort, shaders};
use crate::{Error, Result};
use std::collections::HashMap;

/// What was built, beside the number of its primitives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefitOptions {
    /// The costs that it was built with; whether it was collapsed means nothing here.
    pub costs: Collapse,
    /// How the phases are recorded; `None` takes what measured faster for the size.
    pub schedule: Option<RefitSchedule>,
    /// What it was built over.
    pub primitives: Primitives,
    /// How many geometries: what [`Source::Several`] has, otherwise 1.
    pub geometry_count: u32,
    /// Whether triangles were split: such a structure cannot be refitted, for a part that has moved is another.
    pub is_split: bool,
}

impl RefitOptions {
    /// One geometry of triangles, the costs of [`Collapse::SAH`].
    pub const DEFAULT: RefitOptions = RefitOptions {
        costs: Collapse::SAH,
        schedule: None,
        primitives: Primitives::Triangles,
        geometry_count: 1,
        is_split: false,
    };
}

impl Default for RefitOptions {
    fn default() -> RefitOptions {
        RefitOptions::DEFAULT
    }
}

impl From<&builder::BuildOptions> for RefitOptions {
    /// For what was built with these.
    fn from(built: &builder::BuildOptions) -> RefitOptions {
        let &builder::BuildOptions { collapse, primitives, geometry_count, split, .. } = built;
        RefitOptions { costs: collapse, schedule: None, primitives, geometry_count, is_split: split.is_some() }
    }
}

/// How the phases of a refit are recorded. The result is the same bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RefitSchedule {
    /// A dispatch a phase, with a barrier between.
    Chain,
    /// One workgroup does both, in one dispatch: for few primitives.
    Workgroup,
}

/// Refits structures of a given number of primitives on one device.
#[derive(Debug, Clone)]
pub struct Refit {
    planned: Planned,
    costs: Collapse,
    schedule: RefitSchedule,
    workgroup: u32,
    run: u32,
}

/// A refit with its input and memory, ready to be recorded.
#[derive(Debug, Clone, Copy)]
pub struct RefitJob<'a> {
    /// The refit.
    pub refit: &'a Refit,
    /// The primitives as they are now.
    pub input: Input,
    /// The structure.
    pub structure: Region,
    /// Scratch memory, of [`Refit::scratch_bytes`].
    pub scratch: Region,
}

/// Updates that fit into the push constants.
const AT_ONCE: usize = 2;

impl Refit {
    /// Refitting of structures that were built over `primitive_count` primitives, on the device of `context`.
    ///
    /// # Errors
    /// More primitives than a structure can hold; split triangles.
    pub fn new(context: &Context, options: &RefitOptions, primitive_count: u32) -> Result<Refit> {
        if primitive_count > radix_sort::MAX_COUNT {
            return Err(Error::Argument(format!(
                "{primitive_count} primitives: a structure holds at most {}",
                radix_sort::MAX_COUNT
            )));
        }
        let &RefitOptions { costs, schedule, primitives, geometry_count, is_split } = options;
        if is_split {
            return Err(Error::Argument(
                "a structure with split triangles cannot be updated; build it again, or build it without split".into(),
            ));
        }
        let (tuning, workgroup) = (&context.tuning.refit, context.tuning.group);
        let of_count = if primitive_count <= tuning.small { RefitSchedule::Workgroup } else { RefitSchedule::Chain };
        let schedule = schedule.unwrap_or(of_count);
        let run = if primitive_count <= workgroup * tuning.run { tuning.short_run } else { tuning.run };
        let planned = Planned { primitives, primitive_count, geometry_count };
        Ok(Refit { planned, costs, schedule, workgroup, run })
    }

    /// The schedule that is used: that of the options, or the choice for this number of primitives.
    pub fn schedule(&self) -> RefitSchedule {
        self.schedule
    }

    /// Bytes of the scratch memory: they suffice for refits of fewer primitives, too.
    pub fn scratch_bytes(&self) -> u64 {
        let slots = node_slots(self.planned.primitive_count);
        // The way up and a cost for each slot, two words for each run.
        let words = 2 * u64::from(slots) + 2 * u64::from(slots.div_ceil(self.run));
        (4 * words).next_multiple_of(16)
    }

    fn kernel(&self, shader: &'static shaders::Shader, input: &Input) -> Kernel {
        let source = input.source_constant(self.planned.primitives);
        Kernel::new(shader, self.workgroup, &[self.run, 0, 0, 0, source])
    }

    /// Records the refit of `structure` to `input`, with scratch memory of [`Refit::scratch_bytes`], both aligned to 16 bytes.
    ///
    /// The structure must have been built over as many primitives with the same options; it may be compacted. Any other
    /// structure stays as it is. Before, the caller makes input and structure visible to compute shaders. After, it places a
    /// barrier from compute shader writes to whatever reads the structure or writes the scratch memory. Labels: `leaves` and
    /// `climb`, or `refit` where one workgroup does both; of a top level `far` behind that.
    ///
    /// # Errors
    /// The memory is too small; the input has another number of primitives or geometries than was planned for; a pipeline could
    /// not be made.
    pub fn record(&self, recorder: &mut Recorder<'_>, input: &Input, structure: Region, scratch: Region) -> Result<()> {
        recorder.chains(&[self.steps(input, structure, scratch)?])
    }

    /// The steps of [`Refit::record`]. [`Recorder::chains`] records them side by side with others.
    ///
    /// # Errors
    /// As [`Refit::record`], pipelines aside.
    pub fn steps(&self, input: &Input, structure: Region, scratch: Region) -> Result<Vec<Step>> {
        let mut chains = Refit::chains(&[RefitJob { refit: self, input: *input, structure, scratch }])?;
        Ok(chains.pop().unwrap_or_default())
    }

    /// The chains of many refits, for [`Recorder::chains`]: one per refit, except that two refits by one workgroup each share a
    /// dispatch.
    ///
    /// # Errors
    /// As [`Refit::record`], pipelines aside.
    pub fn chains(jobs: &[RefitJob<'_>]) -> Result<Vec<Vec<Step>>> {
        let mut chains = Vec::new();
        // What fills the push constants together must be of one kind.
        let mut kinds: HashMap<(Kernel, [u32; 2]), usize> = HashMap::new();
        let mut small: Vec<(&Refit, Kernel, Vec<arguments::Update>)> = Vec::new();
        for job in jobs {
            let update = job.update()?;
            let RefitJob { refit, input, .. } = job;
            let costs = [refit.costs.c_t, refit.costs.c_i];
            match refit.schedule {
                _ if update.primitive_count == 0 => {}
                RefitSchedule::Chain => {
                    let groups = update.primitive_count.div_ceil(refit.workgroup * refit.run);
                    let arguments = arguments_of(&[update], costs);
                    let step = |phase, shader| Step::new(phase, refit.kernel(shader, input), &arguments, groups);
                    let steps = [step("leaves", &shaders::BVH_REFIT_LEAVES), step("climb", &shaders::BVH_REFIT_CLIMB)];
                    chains.push(steps.into_iter().chain(refit.far_steps(&[update])).collect());
                }
                RefitSchedule::Workgroup => {
                    let kernel = refit.kernel(&shaders::BVH_REFIT_WORKGROUP, input);
                    let at = *kinds.entry((kernel.clone(), costs.map(f32::to_bits))).or_insert_with(|| {
                        small.push((*refit, kernel.clone(), Vec::new()));
                        small.len() - 1
                    });
                    small[at].2.push(update);
                }
            }
        }
        for (refit, kernel, updates) in &small {
            let costs = [refit.costs.c_t, refit.costs.c_i];
            chains.extend(updates.chunks(AT_ONCE).map(|pair| {
                let step = Step::new("refit", kernel.clone(), &arguments_of(pair, costs), pair.len() as u32);
                std::iter::once(step).chain(refit.far_steps(pair)).collect::<Vec<_>>()
            }));
        }
        Ok(chains)
    }

    /// Of top levels, what tells again what is far: boxes have moved.
    fn far_steps(&self, updates: &[arguments::Update]) -> impl Iterator<Item = Step> {
        let is_top = self.planned.primitives == Primitives::Instances;
        updates.iter().filter(move |_| is_top).map(|update| far::step(update.structure, true))
    }
}

fn arguments_of(given: &[arguments::Update], [c_t, c_i]: [f32; 2]) -> arguments::Refit {
    let mut updates = [given[0]; AT_ONCE];
    updates[..given.len()].copy_from_slice(given);
    arguments::Refit { updates, c_t, c_i }
}

impl RefitJob<'_> {
    fn update(&self) -> Result<arguments::Update> {
        let RefitJob { refit, input, structure, scratch } = *self;
        refit.planned.check(&input)?;
        let (geometry, formats) = input.for_kernels();
        let structure = structure.checked("the BVH to refit", NODES_OFFSET, 16)?;
        let scratch = scratch.checked("scratch memory of a refit", refit.scratch_bytes(), 16)?;
        Ok(arguments::Update {
            vertices: geometry.vertices,
            indices: geometry.indices,
            transform: geometry.transform,
            structure,
            scratch,
            vertex_stride: geometry.vertex_stride,
            vertex_count: geometry.vertex_count,
            formats,
            primitive_count: refit.planned.primitive_count,
        })
    }
}
