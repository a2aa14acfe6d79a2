//! Many small structures: in one call, with arguments in push constants or in memory, in a call each within one submit, and in a submit each.

use super::points::{self, AccelEntry, Submission};
use super::{AccelSetup, WARM_UPS};
use crate::Result;
use crate::device::{Buffer, Device};
use crate::measure::{Sink, Spread, in_turn, ratios};
use crate::scene::{self, LoadOptions};
use crate::subjects::preference::Preference;
use crate::subjects::structures::{BuildInfo, Geometry, Range, Structures, triangles_of};
use ash::vk;
use hedgerow::accel;
use std::time::Instant;

/// Structures of 12 to 478 triangles, out of one pair of buffers.
pub struct Workload<'a> {
    geometries: Vec<Geometry>,
    ranges: Vec<Range>,
    _buffers: [Buffer<'a>; 2],
}

impl<'a> Workload<'a> {
    /// So many structures of small triangles anywhere.
    ///
    /// # Errors
    /// Too little memory; more triangles than a scene may have.
    pub fn new(device: &'a Device, structure_count: u32) -> Result<Workload<'a>> {
        let mut first = 0;
        let range = |i: u32| {
            let count = 12 + (u64::from(i) * 7919 % 467) as u32;
            let range = Range::default().primitive_count(count).primitive_offset(12 * first);
            first += count;
            range
        };
        let ranges: Vec<Range> = (0..structure_count).map(range).collect();
        let soup = scene::load(&format!("gen:soup:{first}:1"), &LoadOptions::default())?;
        let positions = device.upload("positions", &soup.mesh.positions)?;
        let indices = device.upload("indices", &soup.mesh.triangles)?;
        let geometry = triangles_of(&soup.mesh, &positions, &indices);
        Ok(Workload { geometries: vec![geometry; ranges.len()], ranges, _buffers: [positions, indices] })
    }

    /// How many structures.
    pub fn count(&self) -> usize {
        self.ranges.len()
    }

    /// Triangles of the first `count` structures.
    fn triangles(&self, count: usize) -> u64 {
        self.ranges[..count].iter().map(|range| u64::from(range.primitive_count)).sum()
    }
}

/// Room for all structures of a [`Workload`], and the builds that fill it.
pub struct Batch<'w, 'a> {
    structures: Structures<'a>,
    /// The same with arguments in memory, where there is that.
    by_table: Option<Structures<'a>>,
    infos: Vec<BuildInfo<'w>>,
    ranges: Vec<&'w [Range]>,
    _memory: [Buffer<'a>; 3],
}

impl<'w, 'a> Batch<'w, 'a> {
    /// Places each structure and its scratch memory in two large buffers.
    ///
    /// # Errors
    /// Too little memory.
    pub fn new(structures: Structures<'a>, workload: &'w Workload<'_>, prefer: Preference) -> Result<Batch<'w, 'a>> {
        let ranges: Vec<&[Range]> = workload.ranges.iter().map(std::slice::from_ref).collect();
        let plain = |i: usize| {
            BuildInfo::default()
                .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
                .flags(prefer.flags())
                .geometries(&workload.geometries[i..=i])
        };
        let mut end = [0u64; 2];
        let mut places = Vec::with_capacity(ranges.len());
        for (i, range) in workload.ranges.iter().enumerate() {
            let sizes = structures.sizes(&plain(i), &[range.primitive_count])?;
            places.push((end, sizes.acceleration_structure_size));
            end[0] += sizes.acceleration_structure_size.next_multiple_of(256);
            end[1] += sizes.build_scratch_size.next_multiple_of(256);
        }
        let memory = structures.device.buffer("structures", end[0])?;
        let scratch = structures.device.buffer("scratch", end[1] + 256)?;
        let scratch_begin = scratch.address().next_multiple_of(256);
        let bytes = accel::Device::argument_bytes(ranges.len() as u64, ranges.len() as u64);
        let arguments = structures.device.buffer("arguments", bytes)?;
        let by_table = structures.with_arguments_in(&arguments);
        let infos = Vec::with_capacity(ranges.len());
        let mut batch = Batch { structures, by_table, infos, ranges, _memory: [memory, scratch, arguments] };
        for (i, (begin, bytes)) in places.into_iter().enumerate() {
            let create = vk::AccelerationStructureCreateInfoKHR::default()
                .buffer(batch._memory[0].raw())
                .offset(begin[0])
                .size(bytes)
                .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL);
            let structure = batch.structures.create(&create)?;
            let scratch = vk::DeviceOrHostAddressKHR { device_address: scratch_begin + begin[1] };
            batch.infos.push(plain(i).dst_acceleration_structure(structure).scratch_data(scratch));
        }
        Ok(batch)
    }

    /// Builds the first `count` structures; milliseconds by the wall's clock.
    ///
    /// # Errors
    /// A build cannot be recorded or run.
    pub fn build(&self, way: Submission, count: usize) -> Result<f64> {
        let device = self.structures.device;
        let (infos, ranges) = (&self.infos[..count], &self.ranges[..count]);
        let each = || infos.chunks(1).zip(ranges.chunks(1));
        let start = Instant::now();
        match way {
            Submission::OneCall => device.run(None, |recorder| self.structures.build(recorder, infos, ranges))?,
            Submission::OneTable => {
                let structures = self.by_table.as_ref().unwrap_or(&self.structures);
                device.run(None, |recorder| structures.build(recorder, infos, ranges))?
            }
            Submission::OneSubmit => device.run(None, |recorder| {
                each().try_for_each(|(infos, ranges)| self.structures.build(recorder, infos, ranges))
            })?,
            Submission::SubmitEach => each().try_for_each(|(infos, ranges)| {
                device.run(None, |recorder| self.structures.build(recorder, infos, ranges))
            })?,
            Submission::EmptySubmits => each().try_for_each(|_| device.run(None, |_| Ok(())))?,
        }
        Ok(start.elapsed().as_secs_f64() * 1e3)
    }
}

impl Drop for Batch<'_, '_> {
    fn drop(&mut self) {
        for info in &self.infos {
            self.structures.destroy(info.dst_acceleration_structure);
        }
    }
}

/// Measures every way, ours and the driver's in turn, with up to `most` structures that prefer this.
///
/// # Errors
/// Too little memory; the device failed.
pub fn measure(stage: &AccelSetup<'_>, most: u32, prefer: Preference, point: &mut Sink<'_, AccelEntry>) -> Result<()> {
    let workload = Workload::new(stage.device, most)?;
    let makers = stage.makers();
    let batches: Vec<Batch<'_, '_>> =
        makers.iter().map(|maker| Batch::new(maker.clone(), &workload, prefer)).collect::<Result<_>>()?;
    for count in counts(most) {
        (stage.say)(&format!("batch of {count}, {prefer}"));
        let ways = [Submission::OneCall, Submission::OneTable, Submission::OneSubmit, Submission::SubmitEach];
        let all = batches.iter().flat_map(|batch| ways.map(|way| (batch, way)));
        let can = |&(batch, way): &(&Batch<'_, '_>, _)| way != Submission::OneTable || batch.by_table.is_some();
        let mut subjects: Vec<(&Batch<'_, '_>, Submission)> = all.filter(can).collect();
        subjects.push((&batches[0], Submission::EmptySubmits));
        let samples = in_turn(&mut subjects, WARM_UPS, stage.runs, |(batch, way)| batch.build(*way, count as usize));
        let samples: Vec<Vec<f64>> = samples.into_iter().collect::<Result<_>>()?;
        for ((batch, way), times) in subjects.iter().zip(&samples) {
            point(AccelEntry::Batch(points::Batch {
                structures: count,
                triangles: workload.triangles(count as usize),
                prefer,
                maker: (*way != Submission::EmptySubmits).then(|| batch.structures.maker()),
                way: *way,
                wall_ms: Spread::of_some(times)?,
                over_our_call: Spread::of_some(&ratios(times, &samples[0]))?,
            }))?;
        }
    }
    Ok(())
}

/// The most, and a sixteenth, and a sixteenth of that…
fn counts(most: u32) -> Vec<u32> {
    let mut counts: Vec<u32> =
        std::iter::successors(Some(most), |count| Some(count / 16)).take_while(|&count| count > 0).take(3).collect();
    counts.reverse();
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_end_with_the_most_and_never_with_nothing() {
        assert_eq!(counts(4096), [16, 256, 4096]);
        assert_eq!(counts(20), [1, 20]);
        assert_eq!(counts(1), [1]);
    }
}
