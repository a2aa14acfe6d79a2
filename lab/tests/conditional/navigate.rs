//! `hedgerow navigate`: what the page holds, how a reader steps through it, and what is refused.

use crate::browser::Browser;
use crate::conditional::needs;
use std::path::Path;
use std::process::{Command, Output};

crate::conditional::tests! {
    a_reader_steps_through_both_trees: needs::browser(),
    of_too_many_boxes_those_are_drawn_that_are_seen: needs::nothing(),
    pages_of_two_scenes_name_each_other: needs::nothing(),
    what_cannot_be_drawn_is_refused: needs::nothing(),
}

fn navigate(scene: &str, builders: &str, folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hedgerow"))
        .args(["navigate", scene, "-b", builders, "--size", "160x120", "--boxes", "50", "-o"])
        .arg(folder)
        .env_remove("HEDGEROW_SCENES")
        .output()
        .expect("the binary starts")
}

/// Steps down by the button, to the root by the slider, and to the last level by the table.
const LOOK: &str = r#"
  const trees = all(".navigator").map((tree) => {
    const shown = () => [...tree.querySelectorAll("g")].filter((g) => getComputedStyle(g).display !== "none");
    const slider = tree.querySelector("input"), words = () => tree.querySelector("output").textContent;
    const states = [];
    const note = () => states.push([shown().length, Number(shown()[0].dataset.level), Number(tree.querySelector("tr.now").dataset.level), words()]);
    note();
    tree.querySelector("[data-by='1']").click();
    note();
    slider.value = 0;
    slider.dispatchEvent(new Event("input"));
    note();
    tree.querySelector("tbody tr:last-child th button").click();
    note();
    const stage = tree.querySelector("svg").getBoundingClientRect();
    slider.value = 0;
    slider.dispatchEvent(new Event("input"));
    const root = shown()[0].getBBox();
    return {
      states, levels: tree.querySelectorAll("g").length, rows: tree.querySelectorAll("tbody tr").length,
      background: getComputedStyle(tree.querySelector("svg")).backgroundImage.includes("data:image/png"),
      shape: stage.width / stage.height, inside: root.x > 0 && root.y > 0 && root.x + root.width < 1600 && root.y + root.height < 1200,
    };
  });
  return { trees };"#;

fn a_reader_steps_through_both_trees() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let done = navigate("gen:icosphere:3", "kd-binned,lbvh-host", folder.path());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let path = folder.path().join("navigate-gen-icosphere-3.html");
    assert_eq!(String::from_utf8_lossy(&done.stdout).trim(), path.display().to_string());
    let page = std::fs::read_to_string(&path).expect("written");
    for says in ["gen:icosphere:3, level by level", "Level 0: 1 node, all drawn", "empty leaf", "of the cost"] {
        assert!(page.contains(says), "{says}");
    }
    let browser = Browser::find();
    let found = browser.look(&path, LOOK);
    assert_eq!(found["sections"], serde_json::json!(["tree-kd-binned", "tree-lbvh-host", "method"]));
    for tree in found["trees"].as_array().expect("two trees") {
        assert_eq!(tree["levels"], tree["rows"], "{tree}");
        let last = tree["levels"].as_u64().expect("a count") - 1;
        let states = tree["states"].as_array().expect("states");
        for (state, level) in states.iter().zip([4, 5, 0, last]) {
            assert_eq!((&state[0], &state[1], &state[2]), (&1.into(), &level.into(), &level.into()), "{tree}");
            assert!(state[3].as_str().is_some_and(|words| words.starts_with(&format!("Level {level}: "))), "{tree}");
        }
        assert_eq!((&tree["background"], &tree["inside"]), (&true.into(), &true.into()), "{tree}");
        let shape = tree["shape"].as_f64().expect("a ratio");
        assert!((shape - 4.0 / 3.0).abs() < 0.02, "{tree}");
    }
}

fn of_too_many_boxes_those_are_drawn_that_are_seen() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(navigate("gen:soup:2000:1", "kd-binned", folder.path()).status.success());
    let page = std::fs::read_to_string(folder.path().join("navigate-gen-soup-2000-1.html")).expect("written");
    assert!(page.contains("Level 5: 32 nodes, all drawn"), "{}", &page[page.len() - 9000..]);
    let full = page.matches(", 50 drawn\"").count();
    assert!(full > 3, "{full} levels have more than 50 boxes in the picture");
}

fn pages_of_two_scenes_name_each_other() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for scene in ["gen:icosphere:1", "gen:icosphere:2"] {
        assert!(navigate(scene, "sweep", folder.path()).status.success());
    }
    let page = std::fs::read_to_string(folder.path().join("navigate-gen-icosphere-2.html")).expect("written");
    assert!(page.contains("href=\"navigate-gen-icosphere-1.html\">Trees of gen-icosphere-1</a>"));
    assert!(!page.contains("href=\"navigate-gen-icosphere-2.html\""), "not itself");
}

fn what_cannot_be_drawn_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (builders, says) in [("lvbh", "unknown builder \"lvbh\""), ("kd-binned:bins=1", "bins=1 is unknown")] {
        let output = navigate("gen:icosphere:1", builders, folder.path());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(says), "{said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder of our own").count(), 0);
}
