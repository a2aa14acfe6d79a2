//! What `hedgerow build` says.

use crate::program::{err, hedgerow, out};
use hedgerow_lab::measure::record::Record;
use std::collections::BTreeSet;

#[test]
fn kernels_are_phases_where_they_are_asked_for() {
    let builders = "hploc:width=8q,kd-gpu,binned";
    let arguments = ["--runs", "2", "--epo", "off", "--by-kernel", "-q", "--json", "-"];
    let output = hedgerow(&[&["build", "gen:icosphere:5", "-b", builders][..], &arguments].concat());
    assert!(output.status.success(), "{}", err(&output));
    let records: Vec<Record> = out(&output).lines().map(|line| serde_json::from_str(line).expect("a record")).collect();
    let of_each =
        [&["bvh/encode/bounds", "gpu/radix_sort/scatter", "bvh/wide/nodes"][..], &["kdtree/builder/plan"], &[]];
    for (record, kernels) in records.iter().zip(of_each) {
        let names: BTreeSet<&str> = record.build.phases.iter().map(|phase| phase.name.as_str()).collect();
        assert_eq!(names.len(), record.build.phases.len(), "{}: {names:?}", record.builder);
        assert!(kernels.iter().all(|kernel| names.contains(kernel)), "{}: {names:?}", record.builder);
        assert_eq!(names.iter().all(|name| name.contains('/')), !kernels.is_empty(), "{}: {names:?}", record.builder);
        let sum: f64 = record.build.phases.iter().map(|phase| phase.median_ms).sum();
        // Medians of two runs are means, so that they add up.
        assert!((sum / record.build.median_ms - 1.0).abs() < 1e-6, "{}: {sum} ms", record.builder);
    }
    assert_eq!(records.len(), of_each.len());
}
