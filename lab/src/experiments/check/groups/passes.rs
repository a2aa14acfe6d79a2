//! Passes that every builder is made of.

use crate::device::Device;
use crate::device::probe::{self, Findings};
use crate::experiments::check::cases::{Cases, Found, same, same_all};
use crate::experiments::check::corpus::unit_floats;
use crate::random::SplitMix64;
use crate::shaders;
use hedgerow::gpu::Kernel;
use hedgerow::gpu::radix_sort::{self, Sort, SortShape};
use hedgerow::gpu::reduce::{Bounds, Reduction};
use hedgerow::gpu::scan::{self, Scan};

/// Around powers of two, and with these `more` and one less and one more than each.
fn sizes(quick: bool, more: &[u32]) -> Vec<usize> {
    let powers: &[u32] =
        if quick { &[8, 64, 2048] } else { &[4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 65_536] };
    let around = powers.iter().chain(more).flat_map(|&n| [n - 1, n, n + 1]);
    let mut sizes: Vec<usize> = [0, 1, 2].into_iter().chain(around).map(|n| n as usize).collect();
    sizes.sort_unstable();
    sizes.dedup();
    sizes
}

/// Memory keeps what is written, and the driver does as Vulkan says where no property says.
pub fn device(cases: &mut Cases<'_>) {
    for bytes in [4usize, 64 << 10, (16 << 20) + 4] {
        cases.case(format!("{bytes} bytes to the device and back"), |device| {
            let words: Vec<u32> = (0..bytes as u32 / 4).map(|i| i.wrapping_mul(2_654_435_761)).collect();
            let buffer = device.upload("words", &words)?;
            same_all("word", &buffer.read::<u32>(words.len()), &words)
        });
    }
    cases.case("a copy on the device", |device| {
        let words: Vec<u32> = (0..1 << 20).collect();
        let (source, target) = (device.upload("source", &words)?, device.buffer("target", 4 << 20)?);
        let kernel = Kernel::new(&shaders::MEASURE_COPY, device.tuning.group, &[]);
        let count = words.len() as u32 / 4;
        let arguments = crate::measure::copy::arguments(source.address(), target.address(), count);
        device.run(None, |r| r.dispatch(&kernel, &arguments, count.div_ceil(kernel.workgroup())))?;
        same_all("word", &target.read::<u32>(words.len()), &words)
    });
    cases.case("long loops and a small task pool", |device| {
        same("findings", &probe::probe(device)?, &Findings { long_loops: true, task_pool: true })
    });
}

/// Scans in place and to elsewhere, with their totals; bounds of boxes.
pub fn scan_and_reduce(cases: &mut Cases<'_>) {
    let tuning = cases.device.tuning;
    let sizes = sizes(cases.quick, &[tuning.group * tuning.scan_rounds, tuning.group * tuning.reduce_rounds]);
    let most = sizes.last().copied().unwrap_or(0);
    let mut random = SplitMix64::new(1);
    let words: Vec<u32> = (0..most).map(|_| (random.bits() >> 52) as u32).collect();
    let mut next = unit_floats(1);
    let boxes: Vec<Bounds> = (0..most).map(|_| [[next(); 3], [next() + 1.0, next(), 2.0 * next()]]).collect();
    for size in sizes {
        cases.case(format!("scan of {size} words"), |device| scan_is_right(device, &words[..size]));
        cases.case(format!("bounds of {size} boxes"), |device| reduction_is_right(device, &boxes[..size]));
    }
}

pub(super) fn scan_is_right(device: &Device, words: &[u32]) -> Found {
    let scan = Scan::new(device, words.len() as u32);
    let from = device.upload("values", words)?;
    let to = device.buffer("results", 4 * words.len() as u64)?;
    let sums = device.buffer("sums", 4 * u64::from(scan.sums_words()))?;
    let (expected, expected_total) = hedgerow::gpu::twin::scan::exclusive(words);
    for results in [&to, &from] {
        let buffers = scan::ScanBuffers { values: from.address(), results: results.address(), sums: sums.address() };
        device.run(None, |r| scan.record(r, &buffers))?;
        same("total", &sums.read_at::<u32>(4 * u64::from(scan.sums_words() - 1), 1)[0], &expected_total)?;
        same_all("word", &results.read::<u32>(words.len()), &expected)?;
    }
    Ok(())
}

pub(super) fn reduction_is_right(device: &Device, boxes: &[Bounds]) -> Found {
    let reduction = Reduction::new(device, boxes.len() as u32);
    let from = device.upload("boxes", boxes)?;
    let to = device.buffer("result", 24)?;
    let scratch = device.buffer("scratch", 24 * u64::from(reduction.scratch_boxes()))?;
    device.run(None, |r| reduction.record(r, from.address(), to.address(), scratch.address()))?;
    same("bounds", &to.read::<Bounds>(1)[0], &hedgerow::gpu::twin::reduce::bounds(boxes))
}

/// Keys of 32 and 64 bits, of as many bits as matter, with equal ones, by both shapes.
pub fn sort(cases: &mut Cases<'_>) {
    let most = if cases.quick { 20_000 } else { 300_001 };
    let mut random = SplitMix64::new(2);
    let keys: Vec<u64> = (0..most).map(|_| random.bits()).collect();
    for size in sizes(cases.quick, &[most as u32 - 1]) {
        cases.case(format!("{size} keys of 30 bits"), |device| sort_is_right(device, &keys[..size], 30));
    }
    let bits: &[u32] = if cases.quick { &[1, 33, 64] } else { &[1, 7, 8, 9, 17, 31, 32, 33, 48, 63, 64] };
    for &bits in bits {
        cases.case(format!("3000 keys of {bits} bits"), |device| sort_is_right(device, &keys[..3000], bits));
    }
    cases.case("5000 equal keys", |device| sort_is_right(device, &[7; 5000], 32));
    cases.case("5000 keys in reverse", |device| sort_is_right(device, &(0..5000).rev().collect::<Vec<_>>(), 64));
}

pub(super) fn sort_is_right(device: &Device, keys: &[u64], bits: u32) -> Found {
    let mask = if bits == 64 { u64::MAX } else { (1 << bits) - 1 };
    let keys: Vec<u64> = keys.iter().map(|key| key & mask).collect();
    let values: Vec<u32> = (0..keys.len() as u32).rev().collect();
    let expected = hedgerow::gpu::twin::radix_sort::sort(&keys, &values, bits);
    for (name, shape) in [
        ("strips", SortShape::strips(&device.limits)),
        ("tiles", SortShape::tiles(&device.limits)),
        ("tuned", device.tuning.sort),
    ] {
        let (keys, values) = sorted(device, &shape, &keys, &values, bits)?;
        same_all(&format!("{name}: key"), &keys, &expected.0)?;
        same_all(&format!("{name}: value"), &values, &expected.1)?;
    }
    Ok(())
}

fn sorted(
    device: &Device,
    shape: &SortShape,
    keys: &[u64],
    values: &[u32],
    bits: u32,
) -> crate::Result<(Vec<u64>, Vec<u32>)> {
    let count = keys.len() as u32;
    let narrow: Vec<u32> = keys.iter().map(|&key| key as u32).collect();
    let first = if bits > 32 { device.upload("keys", keys) } else { device.upload("keys", &narrow) }?;
    let second = device.buffer("keys", 8 * u64::from(count))?;
    let values = [device.upload("values", values)?, device.buffer("values", 4 * u64::from(count))?];
    let table = device.buffer("table", 4 * shape.table_words(count))?;
    let buffers = radix_sort::SortBuffers {
        keys: [first.address(), second.address()],
        values: [values[0].address(), values[1].address()],
        table: table.address(),
    };
    let mut result = 0;
    device.run(None, |recorder| {
        result = radix_sort::record(recorder, shape, &buffers, &Sort { count, bits, identity: false })?;
        Ok(())
    })?;
    let keys = [&first, &second][result];
    let keys = match bits > 32 {
        true => keys.read::<u64>(count as usize),
        false => keys.read::<u32>(count as usize).into_iter().map(u64::from).collect(),
    };
    Ok((keys, values[result].read(count as usize)))
}

/// The task pool with few and many workers.
pub fn pool(cases: &mut Cases<'_>) {
    let workers: &[u32] = if cases.quick { &[1, 16] } else { &[1, 2, 3, 16, 200, 1024] };
    for phases in [1, 2, 7, 12] {
        for &workers in workers {
            cases.case(format!("{phases} phases, {workers} workers"), |device| {
                let (state, visits, _) = probe::tree(device, phases, workers, 0)?;
                same("status", &state.status, &0)?;
                same("tasks done", &state.done, &((1 << phases) - 1))?;
                same_all("task", &visits, &probe::tree_on_host(phases))
            });
        }
    }
}
