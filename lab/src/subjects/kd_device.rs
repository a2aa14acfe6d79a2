//! kd-trees traced on the device, wherever they were built.

use super::device_rays::DeviceRays;
use crate::Result;
use crate::device::{Buffer, Device};
use hedgerow::kdtree::layout::KdTree;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::kd::{KdTracer, TreeEntry};
use hedgerow::trace::{Hit, Query, Ray, Work};

/// A traversal on the device with its rays; of a structure it needs the address.
pub struct KdDevice<'a> {
    device: &'a Device,
    tracer: KdTracer,
    rays: DeviceRays<'a>,
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

    /// Brings rays to the device; not under the clock.
    ///
    /// # Errors
    /// Too little memory.
    pub fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.rays.set(rays)
    }

    /// Traces the rays once through the structure at an address: milliseconds by timestamps.
    ///
    /// # Errors
    /// The device failed.
    pub fn trace(&mut self, structure: u64, query: Query) -> Result<f64> {
        self.rays.trace(structure, |recorder, buffers| self.tracer.record(recorder, query, buffers))
    }

    /// Traces the rays once through several structures, each an address and the number of its first primitive, one after the
    /// other: milliseconds by timestamps.
    ///
    /// # Errors
    /// The device failed.
    pub fn trace_several(&mut self, structures: &[(u64, u32)], query: Query) -> Result<f64> {
        if let [(structure, 0)] = structures {
            return self.trace(*structure, query);
        }
        let table = self.device.upload("kd-trees", &TreeEntry::table(structures))?;
        self.rays.trace(table.address(), |recorder, buffers| self.tracer.record_several(recorder, query, buffers))
    }

    /// The hits of the last trace.
    pub fn hits(&self) -> Vec<Hit> {
        self.rays.hits()
    }

    /// Steps, tests and leaves of every ray; not under the clock.
    ///
    /// # Errors
    /// The device failed.
    pub fn work(&self, structure: u64, query: Query) -> Result<Option<Vec<Work>>> {
        self.rays.work(structure, |recorder, buffers| self.tracer.record(recorder, query, buffers))
    }

    /// The same through several structures, as [`KdDevice::trace_several`].
    ///
    /// # Errors
    /// The device failed.
    pub fn work_several(&self, structures: &[(u64, u32)], query: Query) -> Result<Option<Vec<Work>>> {
        if let [(structure, 0)] = structures {
            return self.work(*structure, query);
        }
        let table = self.device.upload("kd-trees", &TreeEntry::table(structures))?;
        self.rays.work(table.address(), |recorder, buffers| self.tracer.record_several(recorder, query, buffers))
    }
}
