//! What a [`Spec`](super::Spec) asks for, its options as values; and a builder of ours on the device made from that.

use super::options::OPTIMISE;
use crate::Result;
use crate::device::Device;
use crate::rays::sample::TeachingRays;
use crate::scene::Mesh;
use crate::subjects::Subject;
use crate::subjects::any_hit::AnyHit;
use crate::subjects::device_bvh::{DeviceBvh, Teaching, Walk};
use crate::subjects::host::HostPlan;
use crate::subjects::peers::driver::DriverPreference;
#[cfg(feature = "peer-embree")]
use crate::subjects::peers::embree;
#[cfg(feature = "peer-obvhs")]
use crate::subjects::peers::obvhs;
use crate::subjects::queries::Queries;
use crate::subjects::wide::WidePlan;
use hedgerow::bvh::builder::BuildOptions;
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::wide::Form;
use hedgerow::kdtree::builder::KdOptions;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::wide::{Order, WideTracer};
use hedgerow_host::kdtree::HostKdOptions;
use std::rc::Rc;
use std::time::Duration;

/// What is asked for.
pub(crate) enum BuilderPlan {
    /// One of ours on the device.
    Device(DevicePlan),
    /// One of ours on the host.
    Host(HostPlan),
    /// A kd-tree by one of ours.
    Kd(KdSpec),
    /// The one of ours on the device that is expected to take least for a number of rays per build, by the table of costs.
    Auto(f64),
    /// The Vulkan driver's own.
    Driver(DriverPreference),
    #[cfg(feature = "peer-obvhs")]
    Obvhs(obvhs::Preset),
    #[cfg(feature = "peer-embree")]
    Embree(embree::Preset),
}

/// A builder of kd-trees, for those that build more than one of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KdSpec {
    /// On the host.
    Host {
        /// What it builds.
        options: HostKdOptions,
        /// How its trees are traced.
        traversal: Traversal,
        /// Whether that is on the device.
        traces_on_device: bool,
    },
    /// On the device, which traces them, too.
    Device {
        /// What it builds.
        options: KdOptions,
        /// How its trees are traced.
        traversal: Traversal,
    },
}

/// What rays of the scene have taught, or will.
#[derive(Debug, Clone, Default)]
pub(crate) struct TaughtTree {
    /// How rays that end at any hit are traced.
    pub(crate) any_hit: AnyHit,
    /// Rays by whose visits wide nodes are opened, if not by area.
    pub(crate) opened_by: Option<Rc<TeachingRays>>,
    /// Rays by whose flux rounds of reinsertion move subtrees of the finished tree, if not by area in that of single triangles.
    pub(crate) reinserted_by: Option<Rc<TeachingRays>>,
}

/// A builder of ours on the device.
pub(crate) struct DevicePlan {
    pub(super) options: BuildOptions,
    /// Of the wide tree, where there shall be one.
    pub(super) form: Option<Form>,
    /// How rays go through the tree by queries, if they do.
    pub(super) by_query: Option<Queries>,
    /// The order in which that is traced, where it was given.
    pub(super) order: Option<Order>,
    /// How long reinsertion may take, where it was given a time.
    pub(super) time_to_optimise: Option<Duration>,
}

impl DevicePlan {
    /// The builder on a scene, with the options that depend on the device or that rays teach.
    ///
    /// # Errors
    /// Those of [`DeviceBvh::new`].
    pub(crate) fn make<'a>(
        &self,
        device: &'a Device,
        name: &str,
        mesh: &Mesh,
        taught: &TaughtTree,
    ) -> Result<DeviceBvh<'a>> {
        let wide = self.form.map(|form| {
            let is_ordered = taught.any_hit.order.is_some();
            let left_first = is_ordered.then(|| WideTracer::in_order(device, form, Order::LeftFirst));
            let tracer = match self.order {
                // Where children have an order, their slots say nothing of octants.
                None if is_ordered => WideTracer::in_order(device, form, Order::Distance),
                None => WideTracer::of(device, form),
                Some(order) => WideTracer::in_order(device, form, order),
            };
            WidePlan { tracer, left_first, opened_by: taught.opened_by.clone() }
        });
        let walk = Walk { by_query: self.by_query, wide };
        let mut options = self.options;
        if let Some(time) = self.time_to_optimise {
            let pass = pass_of_reinsertion(device, mesh, &options)?;
            options.optimise = Some(ReinsertionOptions::within(time, pass));
        }
        let rounds = match &taught.reinserted_by {
            Some(rays) => options.optimise.take().map(|options| (&**rays, options)),
            None => None,
        };
        DeviceBvh::new(device, name, mesh, &options, Teaching { walk: &walk, any_hit: &taught.any_hit, rounds })
    }
}

/// What a pass of reinsertion takes on this scene, by the second of two builds: the first warms up.
fn pass_of_reinsertion(device: &Device, mesh: &Mesh, options: &BuildOptions) -> Result<Duration> {
    let mut subject = DeviceBvh::new(
        device,
        "",
        mesh,
        options,
        Teaching { walk: &Walk::default(), any_hit: &AnyHit::NEAR, rounds: None },
    )?;
    subject.build()?;
    let run = subject.build()?;
    let milliseconds: f64 = run.phases.iter().filter(|p| p.name == OPTIMISE.key).map(|p| p.milliseconds).sum();
    Ok(Duration::from_secs_f64(1e-3 * milliseconds))
}
