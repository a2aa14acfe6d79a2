//! PLOC on the device: in rounds, clusters that are each other's nearest become one (Meister and Bittner 2018).
//!
//! `glsl/bvh/ploc.glsl` is the device's side; the twin is [`super::twin::ploc`] with
//! [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::encode::Encode;
use super::geometry::Input;
use super::method::Hierarchy;
use super::scratch::{BuildPhase, Scratch};
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Kernel, Step, arguments};

/// Clusters that one workgroup finishes in less time than rounds of all take.
const FINISH: u32 = 2048;
/// The most rounds that the pool has phases for.
const MOST_ROUNDS: u32 = 38;

/// Rounds until one workgroup goes on: seven tenths of the clusters are left of a round, or a little less. Where more are, that
/// workgroup has more to do.
fn rounds(count: u32) -> u32 {
    let mut rounds = 0;
    let mut left = f64::from(count);
    while left > f64::from(FINISH) && rounds < MOST_ROUNDS {
        left *= 0.7;
        rounds += 1;
    }
    rounds
}

/// The kernels of a build with this radius.
struct Kernels<'a> {
    encode: &'a Encode,
    input: &'a Input,
    radius: u32,
}

impl Kernels<'_> {
    /// `RADIUS_WORD` in ploc.glsl: with the boxes of a tile and its neighbours in shared memory, where workgroups have several
    /// subgroups and the room is there.
    fn radius_word(&self) -> u32 {
        /// Of a box.
        const BYTES: u32 = 24;
        let Kernels { encode, radius, .. } = self;
        let fits = BYTES * (encode.shape.workgroup + 2 * radius) <= encode.shared_left;
        radius | u32::from(!encode.shape.private_counters && fits) << 16
    }

    /// Specialised for even and odd rounds.
    fn of_round(&self, shader: &'static Shader, round: u32) -> Kernel {
        self.encode.reading_kernel_with(shader, self.input, &[self.radius_word(), round % 2])
    }

    fn of_pool(&self, shader: &'static Shader) -> Kernel {
        let rounds = rounds(self.encode.count);
        self.encode.reading_kernel_with(shader, self.input, &[self.radius_word(), rounds])
    }

    /// Kernels and workgroups, a barrier between each two.
    fn chain(&self) -> Vec<(Kernel, u32)> {
        let Kernels { encode, .. } = self;
        let round = |round| {
            [
                (&shaders::BVH_PLOC_SEARCH, encode.shared_tiles()),
                (&shaders::BVH_PLOC_COUNT, encode.shared_tiles()),
                (&shaders::BVH_PLOC_SCAN, 1),
                (&shaders::BVH_PLOC_MERGE, encode.shared_tiles()),
            ]
            .map(|(shader, groups)| (self.of_round(shader, round), groups))
        };
        let rounds = rounds(encode.count);
        let begin = (self.of_round(&shaders::BVH_PLOC_BEGIN, 0), encode.tiles());
        let finish = (self.of_round(&shaders::BVH_PLOC_FINISH, rounds), 1);
        [begin].into_iter().chain((0..rounds).flat_map(round)).chain([finish]).collect()
    }
}

/// Each cluster looks at this many neighbours on either side.
pub(super) struct Ploc {
    pub radius: u32,
}

impl Ploc {
    fn kernels<'a>(&self, encode: &'a Encode, input: &'a Input) -> Kernels<'a> {
        Kernels { encode, input, radius: self.radius }
    }
}

impl Hierarchy for Ploc {
    fn steps(&self, encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
        let chain = self.kernels(encode, input).chain();
        chain.into_iter().map(|(kernel, groups)| Step::new("hierarchy", kernel, arguments, groups)).collect()
    }

    fn persistent(&self, encode: &Encode, input: &Input, shader: &'static Shader) -> [Kernel; 2] {
        let kernels = self.kernels(encode, input);
        [&shaders::BVH_PLOC_RESET, shader].map(|shader| kernels.of_pool(shader))
    }

    fn plan(&self, encode: &Encode, scratch: &mut Scratch) {
        scratch.take_weights(BuildPhase::Hierarchy);
        scratch.take_codes(BuildPhase::Sort);
        scratch.take_ends(BuildPhase::Encode);
        scratch.take_sort();
        scratch.take_clusters(BuildPhase::Hierarchy, BuildPhase::Hierarchy);
        scratch.parts.lists = ["clusters of even rounds", "clusters of odd rounds"]
            .map(|name| scratch.take_words(name, BuildPhase::Hierarchy, BuildPhase::Hierarchy));
        scratch.parts.nearest = scratch.take_words("nearest clusters", BuildPhase::Hierarchy, BuildPhase::Hierarchy);
        scratch.take_sums(encode.shape.workgroup, BuildPhase::Hierarchy, BuildPhase::Hierarchy);
    }
}
