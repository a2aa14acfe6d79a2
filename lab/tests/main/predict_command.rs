//! `hedgerow predict`: what is written of a small scene, and what is refused.

use crate::program::{err, hedgerow, text};
use hedgerow_lab::experiments::predict::record;
use hedgerow_lab::experiments::predict::samples::{Scope, samples};
use hedgerow_lab::subjects::retraced::TreeTracer;
use std::path::Path;
use std::process::Output;

fn run(folder: &Path, more: &[&str]) -> Output {
    let folder = text(folder);
    let arguments = ["predict", "--size", "24x18", "--runs", "1", "-o", folder];
    hedgerow(&[&arguments, more].concat())
}

const TREES: &str = "binned:axes=all:termination=off,lbvh-host,sweep,binned:axes=all:heuristic=rdh,sbvh";

#[test]
fn a_run_leaves_records_and_a_page_that_says_what_they_tell() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done =
        run(folder.path(), &["gen:stadium:3", "gen:icosphere:3", "-b", TREES, "--no-device", "--rays", "primary,ao"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let records = record::read(folder.path()).expect("records");
    assert_eq!(records.len(), 2 * 5);
    assert_eq!(records.iter().filter(|record| record.is_reference()).count(), 2);
    for record in &records {
        assert_eq!(record.host.iter().map(|rays| rays.rays.as_str()).collect::<Vec<_>>(), ["primary", "ao"]);
        assert!(record.device.is_empty() && record.lcv.is_some() && record.epo.is_some(), "{record:?}");
        assert_eq!(record.own.len(), 7, "{record:?}");
        assert!(record.host.iter().all(|rays| rays.ns.min > 0.0 && rays.steps > 0.0), "{record:?}");
    }
    let of = |builder: &str| {
        records.iter().find(|record| record.scene == "gen:stadium:3" && record.builder == builder).expect(builder)
    };
    let (by_area, by_codes) = (of("binned:axes=all:termination=off"), of("lbvh-host"));
    assert!(by_area.sah < by_codes.sah, "{} {}", by_area.sah, by_codes.sah);
    assert!(by_area.own["rdh"] > of("binned:axes=all:heuristic=rdh").own["rdh"], "a tree by rays costs them less");
    let all = samples(&records);
    assert_eq!(Scope::pooled(TreeTracer::Host).points(&all).len(), 2 * 4);
    let page = std::fs::read_to_string(folder.path().join("predict.html")).expect("a page");
    for text in [
        "Traced on the host alone",
        "The reference is binned:axes=all:termination=off",
        "What a build pays for",
        "Soda Hall",
    ] {
        assert!(page.contains(text), "{text} is not on the page");
    }
    for file in ["charts/predict-sah.svg", "charts/predict-work.png", "predict.json"] {
        assert!(folder.path().join(file).is_file(), "{file} is missing");
    }
}

#[test]
fn the_device_traces_the_same_trees() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = run(folder.path(), &["gen:stadium:3", "-b", "sweep,lbvh-host", "--rays", "diffuse1,shadow"]);
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let records = record::read(folder.path()).expect("records");
    assert_eq!(records.len(), 2);
    for record in &records {
        if record.device.is_empty() {
            let page = std::fs::read_to_string(folder.path().join("predict.html")).expect("a page");
            assert!(page.contains("there is no device"), "{page}");
            continue;
        }
        for (host, device) in record.host.iter().zip(&record.device) {
            assert_eq!((&host.rays, host.count), (&device.rays, device.count));
            assert!((host.steps / device.steps - 1.0).abs() < 0.05, "{host:?} {device:?}");
            assert!((host.tests / device.tests - 1.0).abs() < 0.05, "{host:?} {device:?}");
        }
    }
}

#[test]
fn what_cannot_be_compared_is_refused_before_any_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (wrong, says) in [
        (&["-b", "sweep"][..], "one tree has nothing to be compared with"),
        (&["-b", "sweep,sweeep"], "unknown builder"),
        (&["-b", "sweep,kd-exact"], "a kd-tree is not compared with BVHs"),
        (&["-b", "sweep,binned:trace=device"], "leave trace= out"),
        (&["--rays", ""], "unknown kind of ray"),
    ] {
        let done = run(folder.path(), &[&["gen:icosphere:1"], wrong].concat());
        assert_eq!(done.status.code(), Some(2), "{wrong:?}: {}", err(&done));
        assert!(err(&done).contains(says), "{wrong:?}: {}", err(&done));
    }
    assert!(!folder.path().join("predict.jsonl").exists());
    let done = run(folder.path(), &["no-such-scene", "gen:icosphere:1", "-b", "sweep,binned", "--no-device"]);
    assert!(done.status.code() == Some(1) && err(&done).contains("no-such-scene"), "{}", err(&done));
    assert_eq!(record::read(folder.path()).expect("the other scene").len(), 2);
}
