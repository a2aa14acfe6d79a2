//! Kd-trees that the device builds every frame: all in one, all that moves, or each object.

use crate::Result;
use crate::device::{Buffer, Device};
use crate::measure::MemoryRecord;
use crate::scene::{Frame, Group};
use crate::subjects::builders::Spec;
use crate::subjects::kd_device::KdDevice;
use crate::subjects::kd_gpu::KdGpu;
use crate::subjects::{BuildRun, KD_TREE, Subject};
use hedgerow::kdtree::builder::KdOptions;
use hedgerow::kdtree::layout::KdTree;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::{Hit, Query, Ray, Work};
use std::borrow::Cow;

/// Trees on the device, which are traced one after the other.
pub struct OnDevice<'a> {
    builder: String,
    still: Option<Buffer<'a>>,
    parts: Vec<Part<'a>>,
    tracer: KdDevice<'a>,
}

/// A tree that is built every frame.
struct Part<'a> {
    group: Group,
    first: u32,
    subject: KdGpu<'a>,
}

impl<'a> OnDevice<'a> {
    /// A tree of each of `groups`, and `still`, the tree of what stands still, if anything does.
    ///
    /// # Errors
    /// Too little memory; the device failed.
    pub fn new(
        device: &'a Device,
        builder: &Spec,
        (options, traversal): (&KdOptions, Traversal),
        still: Option<KdTree>,
        (first, groups): (&Frame<'_>, Vec<Group>),
    ) -> Result<OnDevice<'a>> {
        let tracer = KdDevice::new(device, traversal)?;
        let builder = builder.to_string();
        let part = |group| {
            let subject = KdGpu::new(device, &builder, &first.mesh(group), options, traversal)?;
            Ok(Part { group, first: first.first(group), subject })
        };
        Ok(OnDevice {
            still: still.map(|tree| tracer.upload(&tree)).transpose()?,
            parts: groups.into_iter().map(part).collect::<Result<_>>()?,
            tracer,
            builder,
        })
    }

    fn trees(&self) -> Vec<(u64, u32)> {
        let still = self.still.iter().map(|still| (still.address(), 0));
        still.chain(self.parts.iter().map(|part| (part.subject.address(), part.first))).collect()
    }
}

impl Subject for OnDevice<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        KD_TREE
    }

    fn timer(&self) -> &'static str {
        self.parts.first().map_or("device", |part| part.subject.timer())
    }

    fn place(&mut self, frame: &Frame<'_>) -> Result<()> {
        for part in &self.parts {
            part.subject.set_positions(&frame.mesh(part.group).positions);
        }
        Ok(())
    }

    fn build(&mut self) -> Result<BuildRun> {
        let milliseconds = self.parts.iter_mut().map(|part| Ok(part.subject.build()?.milliseconds));
        milliseconds.sum::<Result<f64>>().map(BuildRun::whole)
    }

    fn memory(&self) -> MemoryRecord {
        let parts = || self.parts.iter().map(|part| part.subject.memory());
        let still = self.still.iter().map(|still| Some(still.bytes()));
        let structure_bytes = still.chain(parts().map(|memory| memory.structure_bytes)).sum();
        let scratch_bytes = parts().map(|memory| memory.scratch_bytes).sum();
        MemoryRecord { structure_bytes, scratch_bytes, peak_bytes: None }
    }

    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        match (&self.still, &mut self.parts[..]) {
            (None, [part]) => part.subject.kd_tree(),
            _ => Ok(None),
        }
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.tracer.rays.set(rays)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        self.tracer.trace(&self.trees(), query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.tracer.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        self.tracer.work(&self.trees(), query)
    }
}
