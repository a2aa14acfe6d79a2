//! H-PLOC on the device: PLOC within each node of the radix tree, bottom-up in one pass (Benthin et al. 2024).
//!
//! `glsl/bvh/hploc.glsl` is the device's side; the twin is [`super::twin::hploc`] with
//! [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::encode::Encode;
use super::geometry::Input;
use super::method::Hierarchy;
use super::scratch::{BuildPhase, Scratch};
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Context, Kernel, Step, arguments};

/// The clusters that [`Method::Hploc`](super::builder::Method::Hploc) merges at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Window {
    /// Clusters of a window: half of them from each side. Even, 4 to [`Window::MOST`].
    pub size: u32,
    /// Neighbours on either side that a cluster looks at, 1 or more.
    pub radius: u32,
}

impl Window {
    /// The most clusters of a window.
    pub const MOST: u32 = 64;
    /// Each cluster looks at all others, so that one invocation can merge a window by itself. Over eleven scenes trees cost 1.047
    /// times a full sweep's. With [`Window::PAPER`] they cost 1.013 times that, and take more than twice the time on lavapipe.
    pub const DEFAULT: Window = Window { size: 8, radius: 8 };
    /// The window of Benthin et al.: a subgroup of a GPU.
    pub const PAPER: Window = Window { size: 32, radius: 8 };
}

/// How a window is merged. Each way gives the same bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Merging {
    window: Window,
    /// Each invocation merges its own windows (`glsl/bvh/hploc/by_one.glsl`), or teams of them do (`teams.glsl`).
    by_one: bool,
    /// Invocations of a workgroup of the hierarchy's dispatch, at most: on GPUs few, for the workgroup's barriers divide the steps.
    group: u32,
    /// Bytes of shared memory for the windows of teams.
    shared_memory: u32,
}

/// Places of the window that an invocation merges by itself: `SLOTS` in `glsl/bvh/hploc/by_one.glsl`.
const SLOTS: u32 = 8;
/// Shared memory for each place of a team's window.
const PLACE_BYTES: u32 = 44;

impl Merging {
    pub fn of(context: &Context, window: Window) -> Merging {
        let tuning = &context.tuning;
        let sees_all = window.size <= SLOTS && window.radius + 1 >= window.size;
        Merging {
            window,
            by_one: tuning.build.merges_by_one && sees_all,
            group: tuning.small_group,
            // The sort's counters take most of the rest, where one kernel does everything.
            shared_memory: context.limits.shared_memory / 4,
        }
    }

    /// Of a device whose invocations merge their own windows.
    #[cfg(test)]
    pub fn by_one() -> Merging {
        Merging { window: Window::DEFAULT, by_one: true, group: 8, shared_memory: 0 }
    }

    /// Invocations of a team, in workgroups of so many: one for each place, where there is room for as many teams as that makes.
    fn team(&self, workgroup: u32) -> u32 {
        let fits = |team: u32| workgroup / team * self.window.size * PLACE_BYTES <= self.shared_memory;
        let mut team = self.window.size.next_power_of_two();
        while team < workgroup && !fits(team) {
            team *= 2;
        }
        if workgroup.is_multiple_of(team) { team } else { workgroup }
    }

    fn kernel(&self, encode: &Encode, shader: &'static Shader, input: &Input, workgroup: u32) -> Kernel {
        let Merging { window, by_one, .. } = *self;
        let constants = [window.size, window.radius, u32::from(by_one), self.team(workgroup)];
        encode.reading_kernel_with(shader, input, &constants).in_workgroups_of(workgroup)
    }
}

impl Merging {
    /// The one dispatch that does what its steps do, by one workgroup. Label: `hierarchy`.
    pub fn alone_step(&self, encode: &Encode, input: &Input, arguments: &arguments::Build) -> Step {
        let workgroup = encode.shape.workgroup.min(self.group);
        let kernel = self.kernel(encode, &shaders::BVH_HPLOC_HIERARCHY_ALONE, input, workgroup);
        Step::new("hierarchy", kernel, arguments, 1)
    }
}

impl Hierarchy for &Merging {
    fn steps(&self, encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
        let workgroup = encode.shape.workgroup.min(self.group);
        let groups = encode.count.div_ceil(workgroup * encode.items);
        let begin = encode.reading_kernel(&shaders::BVH_HPLOC_BEGIN, input).in_workgroups_of(workgroup);
        let hierarchy = self.kernel(encode, &shaders::BVH_HPLOC_HIERARCHY, input, workgroup);
        [begin, hierarchy].map(|kernel| Step::new("hierarchy", kernel, arguments, groups)).into()
    }

    fn persistent(&self, encode: &Encode, input: &Input, shader: &'static Shader) -> [Kernel; 2] {
        let all = self.kernel(encode, shader, input, encode.shape.workgroup);
        [encode.reset_kernel(&shaders::BVH_HPLOC_RESET), all]
    }

    fn plan(&self, encode: &Encode, scratch: &mut Scratch) {
        scratch.take_weights(BuildPhase::Hierarchy);
        scratch.take_codes(BuildPhase::Hierarchy);
        scratch.take_ends(BuildPhase::Hierarchy);
        scratch.take_sort();
        if !encode.clusters_in_records {
            scratch.take_clusters(BuildPhase::Hierarchy, BuildPhase::Hierarchy);
        }
        scratch.parts.lists[0] = scratch.take_words("list of clusters", BuildPhase::Hierarchy, BuildPhase::Hierarchy);
    }
}
