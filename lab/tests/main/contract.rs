//! The commands and options that outside programs rely on are there, by their names.

use std::process::Command;

/// Each command with its options that are relied on.
const COMMANDS: [(&str, &[&str]); 18] = [
    ("devices", &["--json"]),
    ("build", &["--builder", "--json", "--output", "--runs", "--costs", "--epo"]),
    ("trace", &["--builder", "--rays", "--size", "--json", "--rays-file", "--hits-file", "--any-hit"]),
    ("rays", &["--kind", "--output", "--size"]),
    ("render", &["--builder", "--output", "--view"]),
    ("bench", &["--builder", "--rays", "--runs", "--output", "--shard"]),
    ("cpu-builders", &["--builder", "--size", "--runs", "--quick", "--json", "--output"]),
    ("predict", &["--builder", "--rays", "--size", "--runs", "--no-device", "--output"]),
    ("codes", &["--builder", "--experiments", "--codes", "--rays", "--size", "--runs", "--output"]),
    ("stability", &[]),
    ("compare", &[]),
    ("check", &["--quick", "--json"]),
    ("report", &["--output", "--markdown"]),
    ("accel", &["--output"]),
    ("animate", &["--output"]),
    ("fly", &["--builder", "--cadence", "--output"]),
    ("navigate", &["--output"]),
    ("choose", &["--rays-per-build", "--recalibrate", "--hindsight"]),
];

/// Options of every command.
const COMMON: [&str; 11] = [
    "--device",
    "--validation",
    "--tuning",
    "--seed",
    "--threads",
    "--eye",
    "--look",
    "--fov",
    "--scenes-dir",
    "--quiet",
    "--help",
];

fn help(command: Option<&str>) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_hedgerow")).args(command).arg("--help").output().expect("it starts");
    assert!(output.status.success(), "{command:?}");
    String::from_utf8(output.stdout).expect("text")
}

/// Whether a line of the help begins with this option, or has it behind its short form.
fn offers(help: &str, option: &str) -> bool {
    help.lines().any(|line| line.split([' ', ',', '<', '[']).any(|word| word == option) && line.trim().starts_with('-'))
}

#[test]
fn every_command_and_option_is_there() {
    let all = help(None);
    for option in COMMON {
        assert!(offers(&all, option), "hedgerow {option}");
    }
    for (command, options) in COMMANDS {
        let help = help(Some(command));
        for option in options {
            assert!(offers(&help, option), "hedgerow {command} {option}:\n{help}");
        }
    }
}

#[test]
fn wrong_arguments_exit_with_2_and_failed_work_with_1() {
    let exit = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_hedgerow")).args(arguments).output().expect("it starts").status.code()
    };
    assert_eq!(exit(&["build", "gen:icosphere:1", "-b", "no-such-builder"]), Some(2));
    assert_eq!(exit(&["build", "gen:icosphere:1", "-b", "lbvh:no-such-option=1"]), Some(2));
    assert_eq!(exit(&["rays", "no-such-scene.obj", "--kind", "primary", "-o", "-"]), Some(1));
    assert_eq!(exit(&["no-such-command"]), Some(2));
    assert_eq!(exit(&["rays", "gen:icosphere:1", "--kind", "primary", "-o", "/dev/null"]), Some(0));
}
