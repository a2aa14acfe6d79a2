//! What a builder on the host is taught by: nothing but areas, a scene's camera, or rays that were traced before.

use crate::rays::kinds::{Basis, RayKind};
use crate::rays::sample::{self, ShadowSample};
use crate::scene::Scene;
use crate::{Error, Result};
use hedgerow_host::bvh::heuristic::{
    Heuristic, InteriorForm, Occlusion, Pinhole, Preferred, PreferredRays, RayDistribution, RaySegment, ShadowRays,
};

/// A heuristic as a spec names it, before a scene is known.
#[derive(Debug, Clone, PartialEq)]
pub enum HeuristicSpec {
    /// The surface area.
    Sah,
    /// Rays from anywhere in the scene.
    Interior(InteriorForm),
    /// The scene's camera.
    Camera {
        /// Which rays of it.
        rays: CameraRays,
        /// Their weight beside the area.
        weight: f32,
    },
    /// A sample of rays, by which of them meet a box.
    Distribution {
        /// Their kinds.
        kinds: Vec<RayKind>,
        /// How many, at most.
        most: usize,
        /// Their weight beside the area, where there are many.
        weight: f32,
    },
    /// A frame, by the triangles that are seen.
    Occlusion {
        /// The kinds of its rays.
        kinds: Vec<RayKind>,
        /// The weight of what is seen beside the area.
        weight: f32,
        /// By which rules.
        rules: OcclusionRules,
    },
    /// A sample of rays that end at any hit, by which of them look into a box before they are done.
    Shadow {
        /// Their kinds.
        kinds: Vec<RayKind>,
        /// How many, at most.
        most: usize,
        /// Their weight beside the area, where there are many.
        weight: f32,
    },
}

/// How a tree is built by what is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OcclusionRules {
    /// As the paper's formula has it.
    Plain,
    /// With all rules of its authors.
    Complete,
}

/// Rays of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraRays {
    /// Those through the pixels of its picture.
    Perspective,
    /// All that go where it looks.
    Parallel,
    /// All that begin where it is.
    Spherical,
}

/// The width over the height of the picture that a camera teaches by.
const ASPECT: f32 = 4.0 / 3.0;

/// The same with what the scene gives.
#[derive(Debug, Clone, PartialEq)]
pub enum Taught {
    /// What needs nothing of the scene but its box, or a camera.
    Box(Heuristic<'static>),
    /// Rays, and their weight.
    Rays(Vec<RaySegment>, f32),
    /// Of each triangle whether it is seen, the weight of that, and the rules.
    Seen(Vec<bool>, f32, OcclusionRules),
    /// Rays that end at any hit with all their hits, and their weight.
    Shadows(ShadowSample, f32),
}

impl HeuristicSpec {
    /// Whether it learns from what a camera sees, so that another view teaches otherwise.
    pub fn learns_from_a_view(&self) -> bool {
        !matches!(self, HeuristicSpec::Sah | HeuristicSpec::Interior(_))
    }

    /// With the camera and the rays of `scene`; `None` where there is nothing but a mesh.
    ///
    /// # Errors
    /// The heuristic needs more than a mesh; the scene has no triangles.
    pub fn taught(&self, scene: Option<&Scene>) -> Result<Taught> {
        let scene = || {
            let what = "this heuristic learns from a camera or from rays, and there is only a mesh here; take bench, \
                        build, trace, render or cpu-builders, or heuristic=sah or interior";
            scene.ok_or_else(|| Error::Argument(what.into()))
        };
        Ok(match self {
            HeuristicSpec::Sah => Taught::Box(Heuristic::Sah),
            HeuristicSpec::Interior(form) => Taught::Box(Heuristic::Interior(*form)),
            HeuristicSpec::Camera { rays, weight } => {
                let rays = rays_of(*rays, scene()?);
                Taught::Box(Heuristic::Preferred(Preferred { rays, weight: *weight }))
            }
            HeuristicSpec::Distribution { kinds, most, weight } => {
                Taught::Rays(sample::segments(scene()?, kinds, *most)?, *weight)
            }
            HeuristicSpec::Occlusion { kinds, weight, rules } => {
                Taught::Seen(sample::seen(scene()?, kinds)?, *weight, *rules)
            }
            HeuristicSpec::Shadow { kinds, most, weight } => {
                Taught::Shadows(sample::shadows(scene()?, kinds, *most)?, *weight)
            }
        })
    }
}

fn rays_of(rays: CameraRays, scene: &Scene) -> PreferredRays {
    let camera = &scene.camera;
    match rays {
        CameraRays::Perspective => {
            let (eye, look, up, fov) = (camera.eye, camera.look, camera.up, camera.fov);
            PreferredRays::Perspective(Pinhole { eye, look, up, fov, aspect: ASPECT })
        }
        CameraRays::Parallel => PreferredRays::Parallel(Basis::of(camera, [4, 3]).forward.as_vec3().to_array()),
        CameraRays::Spherical => PreferredRays::Spherical(camera.eye),
    }
}

impl Taught {
    /// How many rays taught it, where they do one by one.
    pub fn rays(&self) -> Option<u64> {
        match self {
            Taught::Rays(segments, _) | Taught::Shadows(ShadowSample { segments, .. }, _) => {
                Some(segments.len() as u64)
            }
            Taught::Box(_) | Taught::Seen(..) => None,
        }
    }

    /// How many triangles were seen, where that is what it learns.
    pub fn seen(&self) -> Option<u64> {
        if let Taught::Seen(seen, ..) = self { Some(seen.iter().filter(|&&seen| seen).count() as u64) } else { None }
    }

    /// What the builder takes.
    pub fn heuristic(&self) -> Heuristic<'_> {
        match self {
            Taught::Box(heuristic) => *heuristic,
            Taught::Rays(segments, weight) => {
                Heuristic::Distribution(RayDistribution { weight: *weight, ..RayDistribution::of(segments) })
            }
            Taught::Seen(seen, weight, rules) => {
                let occlusion = Occlusion { weight: *weight, ..Occlusion::of(seen) };
                match rules {
                    OcclusionRules::Plain => Heuristic::Occlusion(occlusion),
                    OcclusionRules::Complete => Heuristic::OcclusionComplete(occlusion),
                }
            }
            Taught::Shadows(ShadowSample { segments, ends, hits }, weight) => {
                Heuristic::Shadow(ShadowRays { segments, ends, hits, weight: *weight })
            }
        }
    }
}
