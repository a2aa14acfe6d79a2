//! `hedgerow stability`: the records and pages that it leaves, how pages name each other, and what is refused.

use crate::program::{err, program};
use hedgerow_lab::experiments::stability::far::Side;
use hedgerow_lab::experiments::stability::large::LargePlacement;
use hedgerow_lab::experiments::stability::page;
use hedgerow_lab::experiments::stability::points::{Degenerate, Greedy, GreedyKind, Growth, Large};
use hedgerow_lab::experiments::stability::top::points::{GOALS, TopGrowth};
use hedgerow_lab::report::lines;
use hedgerow_lab::scene;
use hedgerow_lab::subjects::preference::Preference;
use std::path::Path;
use std::process::Output;

fn hedgerow(arguments: &[&str], folder: &Path) -> Output {
    program(arguments).arg("-o").arg(folder).output().expect("the binary starts")
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).expect("written")
}

/// Runs it and gives the page that it names.
fn done(arguments: &[&str], folder: &Path, page: &str) -> String {
    let done = hedgerow(arguments, folder);
    assert_eq!(done.status.code(), Some(0), "{arguments:?}: {}", err(&done));
    assert_eq!(String::from_utf8_lossy(&done.stdout).trim(), folder.join(page).display().to_string());
    read(folder, page)
}

#[test]
fn growth_leaves_a_point_for_every_builder_manner_and_step() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let builders = "lbvh:codes=mc63:collapse=off,lbvh-host:codes=emc64var-nosize:collapse=off";
    let size = ["--runs", "2", "--size", "12x8"];
    let arguments =
        [&["stability", "growth", "gen:soup:3000:1", "-b", builders, "--steps", "20,45"], &size[..]].concat();
    let page = done(&arguments, folder.path(), "growth.html");
    let points: Vec<Growth> = lines::entries(folder.path()).expect("records");
    assert_eq!(points.len(), 2 * 2 * 2 * 3);
    for point in &points {
        assert_eq!(point.scene, "gen:soup:3000:1");
        // Kinds that have lost nearly all of their speed are not measured further on.
        let kinds: Vec<&str> = point.relative_mrays.keys().map(String::as_str).collect();
        let all = ["ao", "diffuse1", "primary", "shadow"];
        assert!(kinds.iter().all(|kind| all.contains(kind)) && (point.e > 0 || kinds == all), "{point:?}");
        assert!(point.relative_mrays.values().all(|speed| *speed > 0.0), "{point:?}");
        assert!(point.e > 0 || point.relative_cost == Some(1.0), "{point:?}");
    }
    let cost = |codes: &str, axes, side, e| {
        let point = points.iter().find(|p| p.builder.contains(codes) && (p.by.axes, p.by.side, p.e) == (axes, side, e));
        point.and_then(|point| point.relative_cost).expect("a device and a host builder of ours")
    };
    for side in Side::ALL {
        assert!(cost("mc63", 1, side, 20) > 1.1, "all of x lies in the highest cell");
        assert!(cost("nosize", 1, side, 45) < 1.1, "19 bits are left for 3,000 triangles");
        assert!(cost("nosize", 3, side, 45) > 2.0, "no bit is left");
    }
    assert!(page.contains("<section id=\"scene-gen-soup-3000-1\">"));
    for chart in ["growth-gen-soup-3000-1-1-plus-cost", "growth-gen-soup-3000-1-3-minus-speed-all"] {
        for ending in ["svg", "png"] {
            assert!(folder.path().join(format!("charts/{chart}.{ending}")).is_file(), "{chart}.{ending}");
        }
    }
    let run = page::read_run::<Growth>(folder.path()).expect("read").expect("written");
    assert!(run.setting.command.starts_with("hedgerow stability growth") && run.setting.device.is_some(), "{run:?}");
    assert_eq!((run.failures, run.setting.notes), (vec![], vec![]));
}

#[test]
fn growth_of_top_levels_leaves_a_point_for_every_builder_manner_and_step() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let small = ["--steps", "20,45", "--runs", "1", "--size", "12x8", "--rays", "primary,ao", "--far", "1,9"];
    let builders = ["--codes", "default,emc64var/24", "--prefer", "fast-build", "--rebraid", "on,off"];
    let arguments = [&["stability", "growth", "gen:city:30", "--level", "top"][..], &small, &builders];
    let done = hedgerow(&arguments.concat(), folder.path());
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(
        said.contains("fast-build, re-braided, default") && said.contains("9 far in three axes, side drawn"),
        "{said}"
    );
    assert!(said.trim().ends_with("growth-top.html"), "{said}");
    let points: Vec<TopGrowth> = lines::entries(folder.path()).expect("records");
    // Codes and re-braiding; axes; one far on either side, nine on drawn ones; e.
    assert_eq!(points.len(), 4 * 2 * 3 * 3);
    for point in &points {
        assert_eq!((point.scene.as_str(), point.builder.prefer), ("gen:city:30", Preference::FastBuild));
        let kinds: Vec<&str> = point.relative_mrays.keys().map(String::as_str).collect();
        assert_eq!(kinds, ["ao", "primary"]);
        assert!(point.relative_mrays.values().all(|speed| speed.median > 0.0) && point.relative_frame > Some(0.0));
        let opened = point.entries > point.instances + point.by.far;
        assert!(point.builder.rebraid || !opened, "{point:?}");
        assert!(point.e > 0 || point.relative_cost == Some(1.0), "{point:?}");
        assert!(point.builder.codes.is_none_or(|codes| point.code_bits == codes.bits), "{point:?}");
        // With the default codes what is far costs little, where no instance is opened.
        let cost = point.relative_cost.expect("a city has area");
        let is_default = point.builder.codes.is_none() && !point.builder.rebraid;
        assert!(!is_default || cost <= GOALS[0], "{point:?}");
    }
    let page = read(folder.path(), "growth-top.html");
    assert!(page.contains("<section id=\"scene-gen-city-30\">") && page.contains("fast-build, re-braided, default"));
    let run = page::read_run::<TopGrowth>(folder.path()).expect("read").expect("written");
    assert!(run.setting.device.is_some() && run.failures.is_empty(), "{run:?}");
}

/// Costs are over the tree's own at e = 0, by steps at nodes of eight.
#[test]
fn top_levels_in_nodes_of_eight_grow_too() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let small = ["--steps", "20", "--no-rays", "--runs", "1", "--far", "1", "--axes", "1", "--sides", "+"];
    let builders = ["--prefer", "fast-trace", "--rebraid", "on", "--of-eight", "on,off"];
    let done = hedgerow(
        &[&["stability", "growth", "gen:city:30", "--level", "top"][..], &small, &builders].concat(),
        folder.path(),
    );
    assert_eq!(done.status.code(), Some(0), "{}", err(&done));
    let points: Vec<TopGrowth> = lines::entries(folder.path()).expect("records");
    let of_eight: Vec<bool> = points.iter().map(|point| point.builder.of_eight).collect();
    assert_eq!(of_eight, [true, true, false, false]);
    for point in &points {
        assert!(point.e > 0 || point.relative_cost == Some(1.0), "{point:?}");
        // What is far takes nothing off what is near.
        assert!(point.relative_cost > Some(0.9), "{point:?}");
    }
    assert!(read(folder.path(), "growth-top.html").contains("re-braided, in nodes of eight, default"));
}

/// A goal without the noise of times: what is far costs what stays at most a twentieth, where it is two fifths of all and lies next to the
/// scene, too.
#[test]
fn what_is_far_from_a_top_level_costs_what_stays_little_at_any_distance() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for scene in ["gen:city:150", "gen:forest:150", "gen:cells:150"] {
        let arguments =
            ["stability", "growth", scene, "--level", "top", "--steps", "1,2,33,60", "--runs", "1", "--no-rays"];
        let done = hedgerow(&[&arguments[..], &["--of-eight", "on,off"]].concat(), folder.path());
        assert_eq!(done.status.code(), Some(0), "{}", err(&done));
        let points: Vec<TopGrowth> = lines::entries(folder.path()).expect("records");
        assert_eq!(points.len(), 2 * 2 * 2 * 6 * 5, "preferences, re-braiding, nodes, what is far, e");
        for point in &points {
            assert!(point.relative_cost.is_some_and(|cost| cost <= GOALS[0]), "{point:?}");
        }
        // How far it is makes no difference: steps of a kind follow each other, 0, 1, 2, 33, 60.
        for steps in points.chunks(5) {
            let [_, near, _, _, far] = steps else { panic!("{steps:?}") };
            assert_eq!((near.e, far.e, &near.builder, &near.by), (1, 60, &far.builder, &far.by));
            let [near, far] = [near, far].map(|point| point.relative_cost.expect("measured"));
            assert!((near - far).abs() < 0.005, "{steps:?}");
        }
    }
}

#[test]
fn large_triangles_stand_where_they_are_asked_for() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let builders = "lbvh-host:codes=mc63:collapse=off,lbvh-host:codes=mc63+concise:collapse=off";
    let arguments =
        ["stability", "large", "gen:soup:300:1", "-b", builders, "--steps", "20/10", "--counts", "2", "--no-rays"];
    done(&arguments, folder.path(), "large.html");
    let points: Vec<Large> = lines::entries(folder.path()).expect("records");
    assert_eq!(points.len(), 3 * 2 * 3);
    let cost = |codes: &str, placement| {
        let find = |p: &&Large| p.builder.contains(codes) && p.by.placement == placement && p.e == 20;
        points.iter().find(find).and_then(|point| point.relative_cost).expect("measured")
    };
    // One bit is left to each axis in which the walls are large; concise bounds keep all 21, but where nothing can be cut.
    assert!(cost("mc63:", LargePlacement::Walls) > 1.1 && cost("mc63:", LargePlacement::Wall) > 1.1, "{points:?}");
    assert!(
        cost("mc63+concise", LargePlacement::Walls) < 1.05 && cost("mc63+concise", LargePlacement::Wall) < 1.05,
        "{points:?}"
    );
    assert!(cost("mc63+concise", LargePlacement::Outward) > 1.1, "{points:?}");
    assert!(points.iter().all(|point| point.relative_mrays.is_empty() && point.by.count == 2));
}

#[test]
fn degenerate_scenes_are_built_the_same_every_time_and_pages_name_each_other() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let small =
        ["stability", "degenerate", "--triangles", "70", "--builds", "3", "-b", "lbvh,lbvh:collapse=off,lbvh-host"];
    let page = done(&small, folder.path(), "degenerate.html");
    let points: Vec<Degenerate> = lines::entries(folder.path()).expect("records");
    assert_eq!(points.len(), 3 * scene::degenerate(0).len());
    for point in &points {
        assert!(!point.has_failed() && point.same_bytes == Some(true) && point.valid == Some(true), "{point:?}");
        assert_eq!((point.rays, point.wrong), (256, Some(0)), "{point:?}");
        assert_eq!(point.build_ms.map(|spread| spread.runs), Some(2), "{point:?}");
    }
    assert!(!page.contains("growth.html"));
    let growth = ["stability", "growth", "gen:icosphere:1", "-b", "lbvh-host", "--steps", "1", "--no-rays"];
    assert!(done(&growth, folder.path(), "growth.html").contains("href=\"degenerate.html\""));
    assert!(read(folder.path(), "degenerate.html").contains("href=\"growth.html\""), "it was written again");
    let bench = ["bench", "gen:icosphere:1", "-b", "lbvh-host", "--runs", "1", "--size", "8x8", "--no-pictures"];
    let bench = hedgerow(&bench, folder.path());
    assert_eq!(bench.status.code(), Some(0), "{}", err(&bench));
    let index = read(folder.path(), "index.html");
    assert!(index.contains("href=\"growth.html\"") && index.contains("href=\"degenerate.html\""));
    assert!(!index.contains("large.html"));
    assert!(read(folder.path(), "growth.html").contains("href=\"index.html\""));
}

#[test]
fn greedy_trees_are_measured_beside_the_cheapest_over_scenes_made_and_real() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let arguments = ["stability", "greedy", "gen:icosphere:3", "--seeds", "4", "--most", "15"];
    let page = done(&arguments, folder.path(), "greedy.html");
    let points: Vec<Greedy> = lines::entries(folder.path()).expect("records");
    let of = |kind| points.iter().filter(|point| point.kind == kind).count();
    // 3 to 15 random triangles, 12 displaced ones; 4 tetrahedra have 16 faces.
    assert_eq!(GreedyKind::ALL.map(of), [13 * 4, 2, 0, 2, 2]);
    assert!(points.iter().all(|point| point.ratio() >= 1.0 - 1e-5 && point.optimum > 0.0), "{points:?}");
    assert!(page.contains("icosphere") && page.contains("Over the number of triangles"), "{page}");
    let again = tempfile::tempdir().expect("a temporary folder");
    done(&arguments, again.path(), "greedy.html");
    assert_eq!(
        read(again.path(), "greedy.jsonl"),
        read(folder.path(), "greedy.jsonl"),
        "the same on any number of threads"
    );
}

#[test]
fn points_beyond_the_floats_are_left_out_and_said_so() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let arguments =
        ["stability", "growth", "gen:grid:9", "-b", "lbvh-host", "--axes", "1", "--steps", "60,200", "--no-rays"];
    let page = done(&arguments, folder.path(), "growth.html");
    let points: Vec<Growth> = lines::entries(folder.path()).expect("records");
    assert_eq!(points.iter().map(|point| point.e).collect::<Vec<_>>(), [0, 60, 0, 60]);
    assert!(page.contains("from e = 200 on the far triangle would lie beyond the largest float"), "{page}");
}

#[test]
fn wrong_arguments_are_told_apart_from_failed_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (wrong, says) in [
        (&["hedge"][..], "unrecognized subcommand"),
        (&["growth", "-b", "lvbh"], "unknown builder \"lvbh\""),
        (&["growth", "--axes", "2"], "use 1 or 3"),
        (&["greedy", "--most", "65"], "65 is not in 3..=64"),
        (&["growth", "--sides", "left"], "use + or -"),
        (&["growth", "--level", "middle"], "unknown level \"middle\"; use one of bottom, top"),
        (&["growth", "--level", "top", "-b", "lbvh"], "take --prefer and --codes"),
        (&["growth", "--far", "2"], "--far is for top levels"),
        (&["growth", "--level", "top", "--codes", "emc65"], "or default"),
        (&["growth", "--steps", "60/0"], "LAST/STEP"),
        (&["growth", "--rays", "light"], "unknown kind of ray \"light\""),
        (&["large", "--placements", "roof"], "wall, walls, outward"),
        (&["large", "--counts", "0"], "--counts"),
        (&["degenerate", "hedge"], "unknown degenerate scene \"hedge\"; use one of empty, one"),
        (&["degenerate", "--builds", "0"], "--builds"),
    ] {
        let done = hedgerow(&[&["stability"], wrong].concat(), folder.path());
        assert_eq!(done.status.code(), Some(2), "{wrong:?}: {}", err(&done));
        assert!(err(&done).contains(says), "{wrong:?}: {}", err(&done));
    }
    let done = hedgerow(&["stability", "growth", "no-such-scene", "-b", "lbvh-host"], folder.path());
    assert_eq!(done.status.code(), Some(1), "{}", err(&done));
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").expect("written");
    let done = hedgerow(&["stability", "degenerate", "one", "-b", "lbvh-host"], &file.join("below"));
    assert_eq!(done.status.code(), Some(1));
    assert!(err(&done).contains("check the path"), "{}", err(&done));
}
