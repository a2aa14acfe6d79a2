//! Records as tables for the terminal.

use crate::experiments::bench::matrix::Outcome;
use crate::measure::record::Record;
use crate::report::numbers::{bytes, duration, grouped, three_digits};
use crate::report::table::styled;
use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};

/// A line below the header, and nothing else.
const STYLE: TableStyle = TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// An empty table in our style; columns from `numbers` on are aligned to the right.
pub fn table(header: &[&str], numbers: usize) -> Table {
    styled(STYLE, header.iter().copied(), numbers)
}

fn or_dash<T>(value: Option<T>, text: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".into(), text)
}

/// What was built, on what.
fn heading(record: &Record) -> String {
    let Record { scene, triangles, builder, device, .. } = record;
    format!("{scene}, {} triangles: {builder} on {device}", grouped(*triangles))
}

/// Build time with its phases, quality and memory.
/// Phases stand beside a plain copy of the bytes that they must move, given its rate in GB/s.
pub fn build(outcome: &Outcome, copy_gb_s: Option<f64>) -> String {
    let record = &outcome.record;
    let build = &record.build;
    let mut text = heading(record);
    if let Some(choice) = &outcome.choice {
        text += &format!("\nchosen: {choice}");
    }
    let [median, min, max] = [build.median_ms, build.min_ms, build.max_ms].map(duration);
    let (runs, timer, speed) = (build.runs, &build.timer, three_digits(record.mtris_s()));
    text += &format!("\nbuilt in {median} ({min} to {max}, {runs} runs, {timer} clock)");
    if let Some((threads, cpu)) = build.threads.zip(build.cpu_median_ms) {
        let plural = if threads == 1 { "" } else { "s" };
        text += &format!(" by {threads} thread{plural}, {} of CPU time", duration(cpu));
    }
    text += &format!(": {speed} million triangles a second\n");
    if !build.phases.is_empty() {
        let header = ["phase", "time", "share", "must move", "GB/s", "a copy of it", "of the copy's speed"];
        let mut phases = table(&header, 1);
        let traffic = outcome.traffic.iter().copied().chain(std::iter::repeat(None));
        let each = build.phases.iter().map(|phase| (phase.name.as_str(), phase.median_ms)).zip(traffic);
        // Of all, if it is known of each.
        let all = (("all", build.median_ms), outcome.traffic.iter().copied().sum::<Option<u64>>());
        for ((name, milliseconds), traffic) in each.chain([all]) {
            let copy = traffic.zip(copy_gb_s).map(|(bytes, rate)| bytes as f64 / (rate * 1e6));
            phases.add_row([
                name.to_owned(),
                duration(milliseconds),
                format!("{:.0}%", 100.0 * milliseconds / build.median_ms),
                or_dash(traffic, bytes),
                or_dash(traffic, |bytes| three_digits(bytes as f64 / (milliseconds * 1e6))),
                or_dash(copy, duration),
                or_dash(copy, |copy| format!("{:.0}%", 100.0 * copy / milliseconds)),
            ]);
        }
        text += &format!("{phases}\n");
    }
    let (q, m) = (&record.quality, &record.memory);
    let mut figures = table(&["quality", "", "memory", ""], 4);
    for column in [1, 3] {
        figures.column_mut(column).into_iter().for_each(|c| c.set_cell_alignment(CellAlignment::Right));
    }
    let sah_cost = format!("SAH cost (c_T {}, c_I {})", q.c_t, q.c_i);
    let rows = [
        (sah_cost, or_dash(q.sah, three_decimals), "structure", m.structure_bytes),
        ("area of inner nodes / the root's".into(), or_dash(q.sah_inner, three_decimals), "scratch", m.scratch_bytes),
        ("area of leaves · triangles / the root's".into(), or_dash(q.sah_leaf, three_decimals), "peak", m.peak_bytes),
        ("end-point overlap".into(), or_dash(q.epo, three_decimals), "", None),
        ("leaf count variability".into(), or_dash(q.lcv, three_decimals), "", None),
        ("inner nodes".into(), or_dash(q.inner, grouped), "", None),
        ("leaves".into(), or_dash(q.leaves, grouped), "", None),
        ("leaves without a triangle".into(), or_dash(q.empty_leaves, grouped), "", None),
        ("triangles a leaf, mean".into(), or_dash(q.prims_per_leaf, three_digits), "", None),
        ("triangles a leaf, most".into(), or_dash(q.prims_per_leaf_max, grouped), "", None),
        ("depth, mean".into(), or_dash(q.depth_avg, three_digits), "", None),
        ("depth, most".into(), or_dash(q.depth_max, grouped), "", None),
    ];
    for (quality, value, memory, size) in rows {
        let size = if memory.is_empty() { String::new() } else { or_dash(size, bytes) };
        figures.add_row([quality, value, memory.into(), size]);
    }
    text += &format!("{figures}\n");
    text += match record.valid {
        Some(true) => "valid",
        Some(false) => "NOT VALID",
        None => "not validated",
    };
    text
}

fn three_decimals(value: f64) -> String {
    format!("{value:.3}")
}

/// Speed, steps and tests of each kind of ray.
pub fn trace(record: &Record) -> String {
    let mut kinds = table(&["rays", "count", "hits", "Mrays/s", "steps a ray", "tests a ray"], 1);
    for trace in &record.trace {
        kinds.add_row([
            trace.rays.clone(),
            grouped(trace.count),
            grouped(trace.hits),
            three_digits(trace.mrays_s),
            or_dash(trace.steps, three_digits),
            or_dash(trace.tests, three_digits),
        ]);
    }
    format!("{}\n{kinds}", heading(record))
}
