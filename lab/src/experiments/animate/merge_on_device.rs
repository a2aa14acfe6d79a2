//! Objects that the device merges into the static tree every frame, and takes out again.

use crate::device::{Buffer, Device};
use crate::measure::MemoryRecord;
use crate::scene::{Frame, Group};
use crate::subjects::builders::Spec;
use crate::subjects::kd_device::KdDevice;
use crate::subjects::{BuildRun, KD_TREE, Subject};
use crate::{Error, Result};
use hedgerow::bvh::geometry::Input;
use hedgerow::bvh::layout::status;
use hedgerow::gpu::Timestamps;
use hedgerow::kdtree::builder::KdOptions;
use hedgerow::kdtree::layout::KdTree;
use hedgerow::kdtree::merge::{MergeCapacity, MergeMemory, MergeOptions, MergeReport, Merger, Object};
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::{Hit, Query, Ray, Work};
use std::borrow::Cow;

/// Phases of a restore and a merge at most.
const PHASES: u32 = 400;
/// Merges until there is room for all, each with as much as the one before has found to be needed.
const ATTEMPTS: u32 = 8;

/// The static tree with room, and the objects.
pub struct MergeOnDevice<'a> {
    device: &'a Device,
    builder: String,
    still: KdTree,
    options: MergeOptions,
    most: MergeCapacity,
    objects: Vec<Moving<'a>>,
    place: PlacedMerger<'a>,
    /// Whether objects are in the tree.
    is_merged: bool,
    timestamps: Timestamps,
    tracer: KdDevice<'a>,
}

/// An object and where its vertices are.
struct Moving<'a> {
    group: Group,
    object: Object,
    positions: Buffer<'a>,
    _indices: Buffer<'a>,
}

/// A merger and its memory.
struct PlacedMerger<'a> {
    merger: Merger,
    structure: Buffer<'a>,
    scratch: Buffer<'a>,
    undo: Buffer<'a>,
}

impl<'a> PlacedMerger<'a> {
    /// With the static tree in place.
    fn new(
        device: &'a Device,
        options: &MergeOptions,
        still: &KdTree,
        most: MergeCapacity,
    ) -> Result<PlacedMerger<'a>> {
        let tree = still.clone().with_room(Merger::room(options, most))?;
        let merger = Merger::new(device, options, &tree.header, most)?;
        let sizes = merger.sizes();
        let structure = device.buffer("kd-tree", tree.header.offsets().bytes)?;
        structure.write(&tree.to_bytes());
        let (scratch, undo) = (device.buffer("scratch", sizes.scratch)?, device.buffer("undo", sizes.undo)?);
        Ok(PlacedMerger { merger, structure, scratch, undo })
    }

    fn memory(&self) -> MergeMemory {
        let PlacedMerger { structure, scratch, undo, .. } = self;
        MergeMemory { structure: structure.region(), scratch: scratch.region(), undo: undo.region() }
    }

    fn report(&self) -> MergeReport {
        self.scratch.read_at(self.merger.report_range().start, 1)[0]
    }
}

impl<'a> MergeOnDevice<'a> {
    /// Into `still`, the tree of what stands still; objects as in the first frame.
    ///
    /// # Errors
    /// Too little memory; the device failed.
    pub fn new(
        device: &'a Device,
        builder: &Spec,
        (options, traversal): (KdOptions, Traversal),
        still: KdTree,
        first: &Frame<'_>,
    ) -> Result<MergeOnDevice<'a>> {
        let options = MergeOptions { build: options, ..MergeOptions::DEFAULT };
        let moving = |group: Group| {
            let mesh = first.mesh(group);
            let positions = device.upload("positions", &mesh.positions)?;
            let indices = device.upload("indices", &mesh.triangles)?;
            let (vertices, triangles) = (mesh.positions.len() as u32, mesh.triangles.len() as u32);
            let input = Input::mesh(positions.address(), vertices, indices.address(), triangles);
            let object = Object { input, first_primitive: first.first(group), tree: None };
            Ok(Moving { group, object, positions, _indices: indices })
        };
        let objects: Vec<Moving<'_>> = Group::objects(first).into_iter().map(moving).collect::<Result<_>>()?;
        let triangles = objects.iter().map(|moving| moving.object.input.primitive_count).sum();
        let most = MergeCapacity { objects: objects.len() as u32, triangles };
        Ok(MergeOnDevice {
            device,
            builder: builder.to_string(),
            place: PlacedMerger::new(device, &options, &still, most)?,
            still,
            options,
            most,
            objects,
            is_merged: false,
            timestamps: Timestamps::new(device, PHASES)?,
            tracer: KdDevice::new(device, traversal)?,
        })
    }
}

impl Subject for MergeOnDevice<'_> {
    fn builder(&self) -> &str {
        &self.builder
    }

    fn kind(&self) -> &'static str {
        KD_TREE
    }

    fn timer(&self) -> &'static str {
        self.device.timer()
    }

    fn place(&mut self, frame: &Frame<'_>) -> Result<()> {
        for moving in &self.objects {
            moving.positions.write(&frame.mesh(moving.group).positions);
        }
        Ok(())
    }

    /// Where there was too little room, more is made, and what counts is a merge that had enough.
    fn build(&mut self) -> Result<BuildRun> {
        let objects: Vec<Object> = self.objects.iter().map(|moving| moving.object).collect();
        let mut attempts = 0;
        loop {
            let (place, is_merged) = (&self.place, self.is_merged);
            self.device.run(Some(&mut self.timestamps), |recorder| {
                if is_merged {
                    place.merger.restore(recorder, place.memory())?;
                    recorder.barrier();
                }
                place.merger.record(recorder, place.memory(), &objects)
            })?;
            self.is_merged = true;
            let report = self.place.report();
            if report.status & status::OUT_OF_ROOM == 0 {
                // A merge into a place that is new had nothing to take out: it does not count.
                if is_merged {
                    return Ok(BuildRun::of(self.timestamps.phases()?));
                }
                continue;
            }
            attempts += 1;
            if attempts == ATTEMPTS {
                return Err(Error::Argument(format!("{ATTEMPTS} merges found too little room: {report:?}")));
            }
            self.options.estimate = report.estimate(self.most.triangles);
            self.place = PlacedMerger::new(self.device, &self.options, &self.still, self.most)?;
            self.is_merged = false;
        }
    }

    fn memory(&self) -> MemoryRecord {
        let PlacedMerger { structure, scratch, undo, .. } = &self.place;
        let scratch_bytes = Some(scratch.bytes() + undo.bytes());
        MemoryRecord { structure_bytes: Some(structure.bytes()), scratch_bytes, peak_bytes: None }
    }

    fn kd_tree(&mut self) -> Result<Option<Cow<'_, KdTree>>> {
        let structure = &self.place.structure;
        Ok(Some(Cow::Owned(KdTree::from_bytes(&structure.read::<u8>(structure.bytes() as usize))?)))
    }

    fn set_rays(&mut self, rays: &[Ray]) -> Result<()> {
        self.tracer.rays.set(rays)
    }

    fn trace(&mut self, query: Query) -> Result<f64> {
        self.tracer.trace(&[(self.place.structure.address(), 0)], query)
    }

    fn hits(&mut self) -> Result<Vec<Hit>> {
        Ok(self.tracer.rays.hits())
    }

    fn work(&mut self, query: Query) -> Result<Option<Vec<Work>>> {
        self.tracer.work(&[(self.place.structure.address(), 0)], query)
    }
}
