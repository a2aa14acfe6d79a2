//! What a record says of a builder on the CPU: its phases, its threads, its CPU time and its memory.

use hedgerow_lab::measure::record::Record;
use std::process::Command;

/// The records of builders over a small scene, by the program: only that counts its heap.
fn records(builders: &str, more: &[&str]) -> Vec<Record> {
    let arguments = ["build", "gen:soup:30000:1", "-b", builders, "--runs", "2", "--epo", "off", "-q", "--json", "-"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_hedgerow"));
    let done = command.args(arguments).args(more).output().expect("the binary starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let lines = String::from_utf8(done.stdout).expect("text");
    lines.lines().map(|line| serde_json::from_str(line).expect("a record a line")).collect()
}

#[test]
fn a_record_of_a_builder_on_the_cpu_says_what_the_build_took() {
    let of_embree = if cfg!(feature = "peer-embree") { ",embree-medium-tree,embree-high-tree" } else { "" };
    for record in records(&format!("binned,sweep:threads=2,bonsai:threads=1,lbvh-host,kd-binned{of_embree}"), &[]) {
        let (build, memory, builder) = (&record.build, &record.memory, &record.builder);
        assert!(build.threads.is_some(), "{builder}");
        let cpu = [build.cpu_min_ms, build.cpu_median_ms, build.cpu_max_ms].map(|ms| ms.expect("measured"));
        assert!(0.0 < cpu[0] && cpu[0] <= cpu[1] && cpu[1] <= cpu[2], "{builder}: {cpu:?}");
        let [structure, scratch, peak] =
            [memory.structure_bytes, memory.scratch_bytes, memory.peak_bytes].map(|bytes| bytes.expect("measured"));
        assert!(peak >= structure && scratch == peak - structure, "{builder}: {memory:?}");
        assert!(peak < 1000 * record.triangles, "{builder}: {memory:?}");
        let quality = &record.quality;
        let sums = [quality.sah_inner, quality.sah_leaf].map(|sum| sum.expect("measured"));
        let sah = quality.c_t * sums[0] + quality.c_i * sums[1];
        assert!(quality.sah.is_some_and(|told| (told / sah - 1.0).abs() < 1e-12), "{builder}: {quality:?}");
    }
}

#[test]
fn a_builder_of_bvhs_on_the_cpu_has_phases_that_make_up_its_time() {
    for record in records("binned,sweep:optimise=fast", &[]) {
        let names: Vec<&str> = record.build.phases.iter().map(|phase| phase.name.as_str()).collect();
        let expected: &[&str] = match record.builder.as_str() {
            "binned" => &["boxes", "build", "records", "collapse", "layout"],
            _ => &["boxes", "build", "optimise", "records", "collapse", "layout"],
        };
        assert_eq!(names, expected, "{}", record.builder);
        let sum: f64 = record.build.phases.iter().map(|phase| phase.median_ms).sum();
        // Medians of two runs are means, so that they add up.
        assert!((sum / record.build.median_ms - 1.0).abs() < 1e-6, "{sum} of {} ms", record.build.median_ms);
    }
}

#[test]
fn a_builder_has_its_own_threads_or_those_of_all() {
    let threads = |builders, more: &[&str]| -> Vec<Option<u32>> {
        records(builders, more).iter().map(|record| record.build.threads).collect()
    };
    let builders = "binned,binned:threads=1,sweep:threads=2,lbvh-host";
    assert_eq!(threads(builders, &["--threads", "3"]), [3, 1, 2, 1].map(Some));
}

#[test]
fn a_build_prints_its_threads_and_its_cpu_time() {
    let arguments = ["build", "gen:soup:3000:1", "-b", "binned:threads=1", "--epo", "off", "-q"];
    let done = Command::new(env!("CARGO_BIN_EXE_hedgerow")).args(arguments).output().expect("the binary starts");
    let text = String::from_utf8_lossy(&done.stdout);
    for says in ["by 1 thread,", "of CPU time", "collapse", "scratch", "area of inner nodes / the root's"] {
        assert!(text.contains(says), "{says}: {text}");
    }
}
