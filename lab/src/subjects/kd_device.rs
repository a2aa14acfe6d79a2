//! kd-trees traced on the device, wherever they were built.

use super::device_rays::DeviceRays;
use crate::Result;
use crate::device::{Buffer, Device};
use hedgerow::kdtree::layout::KdTree;
use hedgerow::trace::kd::{KdTracer, Traversal, TreeEntry};
use hedgerow::trace::{Query, Work};

/// A traversal on the device with its rays; of a structure it needs the address.
pub struct KdDevice<'a> {
    device: &'a Device,
    tracer: KdTracer,
    /// What is traced.
    pub rays: DeviceRays<'a>,
}

impl<'a> KdDevice<'a> {
    /// Without rays yet.
    ///
    /// # Errors
    /// The device failed.
    pub fn new(device: &'a Device, traversal: Traversal) -> Result<KdDevice<'a>> {
        Ok(KdDevice { device, tracer: KdTracer::new(device, traversal), rays: DeviceRays::new(device)? })
    }

    /// Brings a tree of the host to the device.
    ///
    /// # Errors
    /// Too little memory.
    pub fn upload(&self, tree: &KdTree) -> Result<Buffer<'a>> {
        self.device.upload("kd-tree", &tree.to_bytes())
    }

    /// Traces the rays once through the structures, each an address and the number of its first primitive, one after the other:
    /// milliseconds by timestamps.
    ///
    /// # Errors
    /// The device failed.
    pub fn trace(&mut self, structures: &[(u64, u32)], query: Query) -> Result<f64> {
        let KdDevice { device, tracer, rays } = self;
        if let [(structure, 0)] = structures {
            return rays.trace(*structure, |recorder, buffers| tracer.record(recorder, query, buffers));
        }
        let table = device.upload("kd-trees", &TreeEntry::table(structures))?;
        rays.trace(table.address(), |recorder, buffers| tracer.record_several(recorder, query, buffers))
    }

    /// Steps, tests and leaves of every ray through them; not under the clock.
    ///
    /// # Errors
    /// The device failed.
    pub fn work(&self, structures: &[(u64, u32)], query: Query) -> Result<Option<Vec<Work>>> {
        let KdDevice { device, tracer, rays } = self;
        if let [(structure, 0)] = structures {
            return rays.work(*structure, |recorder, buffers| tracer.record(recorder, query, buffers));
        }
        let table = device.upload("kd-trees", &TreeEntry::table(structures))?;
        rays.work(table.address(), |recorder, buffers| tracer.record_several(recorder, query, buffers))
    }
}
