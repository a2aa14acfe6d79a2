//! A wide tree made of whatever `Bvh2` a device builder has left: the last phase of a build, and what is measured of it.

use super::counted::Counted;
use crate::Result;
use crate::device::{Buffer, Device};
use crate::measure::record;
use crate::rays::sample::TeachingRays;
use hedgerow::bvh::geometry::Primitives;
use hedgerow::bvh::layout::{Child, Header, Triangle};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::wide::device::{WideCounts, WideOptions, WidePass};
use hedgerow::bvh::wide::layout::{Wide, WideNode};
use hedgerow::bvh::wide::quantised::QuantisedNode;
use hedgerow::bvh::wide::{Form, quality};
use hedgerow::gpu::{Recorder, Region, Sizes};
use hedgerow::trace::Query;
use hedgerow::trace::counts::CountedWalk;
use hedgerow::trace::tracer::TraceBuffers;
use hedgerow::trace::wide::WideTracer;
use std::rc::Rc;

/// Memory for a wide tree of triangles, its collapsing, and what traces it.
pub struct WideTree<'a> {
    /// What traces it.
    pub tracer: WideTracer,
    left_first: Option<WideTracer>,
    collapse: WidePass,
    sizes: Sizes,
    structure: Buffer<'a>,
    scratch: Buffer<'a>,
    /// Rays by whose visits nodes are opened, if not by area.
    counted: Option<Counted<'a>>,
}

/// What a wide tree is traced by, and how its nodes are opened.
#[derive(Debug, Clone)]
pub struct WidePlan {
    /// What traces it.
    pub tracer: WideTracer,
    /// What takes rays through it that end at any hit, where its children have an order.
    pub left_first: Option<WideTracer>,
    /// Rays by whose visits nodes are opened, if not by area.
    pub opened_by: Option<Rc<TeachingRays>>,
}

impl<'a> WideTree<'a> {
    /// For a `Bvh2` of `count` triangles.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(device: &'a Device, plan: &WidePlan, count: u32) -> Result<WideTree<'a>> {
        let WidePlan { tracer, left_first, .. } = *plan;
        let options = WideOptions { form: tracer.form, primitives: Primitives::Triangles, geometry_count: 1 };
        let collapse = WidePass::new(device, &options, count);
        let sizes = collapse.sizes();
        let structure = device.buffer("wide structure", sizes.structure)?;
        let counted = plan.opened_by.as_ref().map(|teaching| {
            let samples = teaching.by_kind.iter().map(|(kind, rays)| (CountedWalk::AsTraced(kind.query()), &rays[..]));
            Counted::new(device, samples, Collapse::SAH, count)
        });
        let counted = counted.transpose()?;
        let counting = counted.as_ref().map_or(0, Counted::scratch_bytes);
        let scratch = device.buffer("wide scratch", sizes.scratch.max(counting))?;
        Ok(WideTree { tracer, left_first, collapse, sizes, structure, scratch, counted })
    }

    /// Records the phase `wide`, behind the build of the `Bvh2` at `source`; before it `rays`, where nodes are opened by visits. Where
    /// rays have taught the order of children, `ordered_by` is what was counted of them.
    ///
    /// # Errors
    /// A pipeline could not be made.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        source: Region,
        ordered_by: Option<Region>,
    ) -> hedgerow::Result<()> {
        recorder.barrier();
        let (target, scratch) = (self.structure.region(), self.scratch.region());
        if let Some(counted) = &self.counted {
            counted.record(recorder, source, scratch)?;
        }
        let counts = WideCounts { opened_by: self.counted.as_ref().map(Counted::counts), ordered_by };
        self.collapse.record_by_counts(recorder, source.address, &counts, target, scratch)
    }

    /// Records the tracing of rays through it.
    ///
    /// # Errors
    /// Those of [`WideTracer::record`].
    pub fn record_trace(
        &self,
        recorder: &mut Recorder<'_>,
        query: Query,
        buffers: &TraceBuffers,
    ) -> hedgerow::Result<()> {
        let left_first = self.left_first.filter(|_| query == Query::AnyHit);
        left_first.unwrap_or(self.tracer).record(recorder, query, buffers)
    }

    /// Address of the structure.
    pub fn address(&self) -> u64 {
        self.structure.address()
    }

    /// The bytes of the structure that are in use.
    pub fn bytes(&self) -> Vec<u8> {
        self.structure.read(self.bytes_in_use() as usize)
    }

    fn bytes_in_use(&self) -> u64 {
        let header: Header = self.structure.read(1)[0];
        self.tracer.form.bytes_in_use(&header, size_of::<Triangle>() as u64)
    }

    /// What the build takes beside `binary`, which is for the `Bvh2` and its build. The structure's bytes are those in use,
    /// for it needs no others; at the peak all is there, as much as it may need.
    pub fn memory(&self, binary: &Sizes) -> record::MemoryRecord {
        let peak = self.sizes.structure + self.sizes.scratch + binary.structure + binary.scratch;
        let in_use = self.bytes_in_use();
        record::MemoryRecord {
            structure_bytes: Some(in_use),
            scratch_bytes: Some(peak - self.sizes.structure),
            peak_bytes: Some(peak),
        }
    }

    /// Its quality: c_t is the cost of a step, whatever the width ([`quality::on_host`]).
    ///
    /// # Errors
    /// The bytes are not such a structure.
    pub fn quality(&self, c_t: f64, c_i: f64) -> Result<record::QualityRecord> {
        let quality = match self.tracer.form {
            Form::Four => quality::on_host(&self.tree::<[Child; 4]>()?, c_t, c_i),
            Form::Eight => quality::on_host(&self.tree::<[Child; 8]>()?, c_t, c_i),
            Form::EightQuantised => quality::on_host(&self.tree::<QuantisedNode>()?, c_t, c_i),
        };
        Ok(record::QualityRecord::of(&quality, c_t, c_i))
    }

    /// Checks every rule of its layout.
    ///
    /// # Errors
    /// [`Wide::validate`] names the rule that is broken.
    pub fn validate(&self) -> Result<()> {
        match self.tracer.form {
            Form::Four => self.tree::<[Child; 4]>()?.validate()?,
            Form::Eight => self.tree::<[Child; 8]>()?.validate()?,
            Form::EightQuantised => self.tree::<QuantisedNode>()?.validate()?,
        }
        Ok(())
    }

    fn tree<N: WideNode>(&self) -> Result<Wide<N, Triangle>> {
        Ok(Wide::from_bytes(&self.bytes())?)
    }
}
