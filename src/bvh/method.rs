//! What a method is: every method of the builder, and what each adds to a build.

use super::encode::Encode;
use super::geometry::Input;
use super::hlbvh::Treelets;
use super::hploc::{Merging, Window};
use super::lbvh::Lbvh;
use super::ploc::Ploc;
use super::scratch::Scratch;
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Kernel, Step, arguments};
use crate::{Error, Result};

/// How a tree is made of the order of codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Linear BVH: split where the highest bit of the codes changes (Lauterbach et al. 2009). The fastest build.
    Lbvh,
    /// Hierarchical LBVH (Pantaleoni and Luebke 2010): subtrees of the LBVH, *treelets*, under a top that the surface area
    /// heuristic splits.
    Hlbvh(Treelets),
    /// Parallel locally-ordered clustering (Meister and Bittner 2018): neighbours in the order, so many places away at most, are
    /// merged in rounds.
    Ploc {
        /// Neighbours on either side that a cluster looks at, 1 to [`Method::MOST_RADIUS`].
        radius: u32,
    },
    /// Hierarchical PLOC (Benthin et al. 2024): neighbours in windows of the order are merged. Better trees for little more time.
    Hploc(Window),
}

impl Method {
    /// The most neighbours that PLOC looks at.
    pub const MOST_RADIUS: u32 = 256;

    /// # Errors
    /// A parameter out of range.
    pub fn check(self) -> Result<()> {
        match self {
            Method::Hploc(Window { size, radius })
                if !(4..=Window::MOST).contains(&size) || !size.is_multiple_of(2) || radius == 0 =>
            {
                Err(Error::Argument(format!(
                    "H-PLOC with a window of {size} and radius {radius}: a window has an even number of clusters from 4 to {}, \
                     and the radius is at least 1",
                    Window::MOST
                )))
            }
            Method::Hlbvh(Treelets { primitives: 0, .. }) => {
                Err(Error::Argument("HLBVH with treelets of no primitives: they have 1 or more".into()))
            }
            Method::Ploc { radius } if !(1..=Method::MOST_RADIUS).contains(&radius) => {
                Err(Error::Argument(format!("PLOC with radius {radius}: it is 1 to {}", Method::MOST_RADIUS)))
            }
            _ => Ok(()),
        }
    }

    /// Whether it climbs the radix tree to the root.
    pub(super) fn climbs(self) -> bool {
        matches!(self, Method::Lbvh | Method::Hploc(_))
    }

    /// What it adds to a build; `merging` is for [`Method::Hploc`].
    pub(super) fn hierarchy<'a>(&'a self, merging: &'a Merging) -> Box<dyn Hierarchy + 'a> {
        match self {
            Method::Lbvh => Box::new(Lbvh),
            Method::Hlbvh(treelets) => Box::new(treelets),
            &Method::Ploc { radius } => Box::new(Ploc { radius }),
            Method::Hploc(_) => Box::new(merging),
        }
    }
}

/// The shaders that do a whole build in one dispatch, one of each method.
#[derive(Debug, PartialEq, Eq, Hash)]
pub struct PersistentShaders {
    lbvh: &'static Shader,
    hlbvh: &'static Shader,
    ploc: &'static Shader,
    hploc: &'static Shader,
}

impl PersistentShaders {
    /// All of them.
    pub(super) const ALL: PersistentShaders = PersistentShaders {
        lbvh: &shaders::BVH_LBVH_PERSISTENT,
        hlbvh: &shaders::BVH_HLBVH_PERSISTENT,
        ploc: &shaders::BVH_PLOC_PERSISTENT,
        hploc: &shaders::BVH_HPLOC_PERSISTENT,
    };

    /// That of a method.
    pub(super) fn of(&self, method: Method) -> &'static Shader {
        match method {
            Method::Lbvh => self.lbvh,
            Method::Hlbvh(_) => self.hlbvh,
            Method::Ploc { .. } => self.ploc,
            Method::Hploc(_) => self.hploc,
        }
    }
}

/// A hierarchy over an order of codes, as one of the methods builds it.
pub(super) trait Hierarchy {
    /// The dispatches behind [`Encode::steps`]. Label: `hierarchy`.
    fn steps(&self, encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step>;

    /// The kernels of a whole build by one dispatch: one resets its state, the other, of `shader`, does everything.
    fn persistent(&self, encode: &Encode, input: &Input, shader: &'static Shader) -> [Kernel; 2];

    /// Takes what it needs of the scratch memory, and what the phases before do, in an order in which least is left unused.
    fn plan(&self, encode: &Encode, scratch: &mut Scratch);

    /// Whether it writes the weights of the nodes, by which collapsing finishes the tree; LBVH finishes its own.
    fn writes_weights(&self) -> bool {
        true
    }

    /// The whole build by `workers` workgroups of one dispatch. Label: `build`.
    fn persistent_steps(
        &self,
        encode: &Encode,
        input: &Input,
        arguments: &arguments::Build,
        shader: &'static Shader,
        workers: u32,
    ) -> Vec<Step> {
        let [reset, all] = self.persistent(encode, input, shader);
        vec![Step::new("build", reset, arguments, 1), Step::new("build", all, arguments, workers)]
    }
}
