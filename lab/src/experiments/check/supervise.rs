//! A group in a process of its own, whose cases have a time limit: whatever happens to it, the rest goes on.

use super::Ground;
use super::cases::{Difference, Message};
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

/// How a group went.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The group.
    pub group: String,
    /// Whether its process ended well with no case that differs.
    pub passed: bool,
    /// Seconds from the start of its process to its end.
    pub seconds: f64,
    /// Cases that were tried.
    pub cases: u32,
    /// Those that differ.
    pub wrong: Vec<Difference>,
    /// What was not tried, and why.
    pub left_out: Vec<String>,
    /// How the process ended, if not by itself when all was done; and in which case.
    pub ended: Option<String>,
}

/// Lines of a child's diagnostics that are kept: the last ones say what happened.
const LAST_LINES: usize = 4;

/// This program once more, started as it was itself: where a dynamic loader was given it to run (scripts/with-lavapipe.sh), by
/// that loader and with what stood before it.
///
/// # Errors
/// The program's own file is not known.
pub fn this_program() -> io::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(loader_arguments());
    Ok(command)
}

/// What the command line has between the running file and the program's arguments: nothing, or what its loader was told.
#[cfg(target_os = "linux")]
fn loader_arguments() -> Vec<OsString> {
    use std::os::unix::ffi::OsStringExt;
    let line = std::fs::read("/proc/self/cmdline").unwrap_or_default();
    let words = line.strip_suffix(b"\0").unwrap_or(&line).split(|&byte| byte == 0);
    let words: Vec<OsString> = words.map(|word| OsString::from_vec(word.to_vec())).collect();
    // The program's own name is the first of its arguments, and of the loader's the last.
    let own = std::env::args_os().count();
    words.get(1..(words.len() + 1).saturating_sub(own)).map(<[_]>::to_vec).unwrap_or_default()
}

#[cfg(not(target_os = "linux"))]
fn loader_arguments() -> Vec<OsString> {
    Vec::new()
}

/// Runs a group in the process that `command` starts, each of its cases at most as long as `limit`. Gives what it ran on, too, if it said
/// so.
pub fn run(group: &str, mut command: Command, limit: Duration) -> (Outcome, Option<Ground>) {
    let begin = Instant::now();
    let mut outcome = Outcome { group: group.to_owned(), ..Outcome::default() };
    let mut child = match command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn() {
        Ok(child) => child,
        Err(error) => {
            outcome.ended = Some(format!("its process did not start: {error}"));
            return (outcome, None);
        }
    };
    let (sender, messages) = mpsc::channel();
    let lines = BufReader::new(child.stdout.take().expect("stdout is piped")).lines();
    // A driver may write to stdout what it likes.
    let sent = lines.map_while(Result::ok).filter_map(|line| serde_json::from_str::<Message>(&line).ok());
    let reader = thread::spawn(move || {
        for message in sent {
            if sender.send(message).is_err() {
                return;
            }
        }
    });
    let mut diagnostics = child.stderr.take().expect("stderr is piped");
    let listener = thread::spawn(move || {
        let mut text = Vec::new();
        let _ = diagnostics.read_to_end(&mut text);
        String::from_utf8_lossy(&text).into_owned()
    });

    let (mut ground, mut last_case, mut is_done) = (None, None, false);
    let in_time = loop {
        // The process says where each case begins, so a wait is as long as a case.
        match messages.recv_timeout(limit) {
            Ok(Message::Ground(found)) => ground = Some(found),
            Ok(Message::Case(name)) => {
                outcome.cases += 1;
                last_case = Some(name);
            }
            Ok(Message::Wrong(difference)) => outcome.wrong.push(difference),
            Ok(Message::LeftOut(what)) => outcome.left_out.push(what),
            Ok(Message::Done) => is_done = true,
            Err(RecvTimeoutError::Disconnected) => break true,
            Err(RecvTimeoutError::Timeout) => break false,
        }
    };
    if !in_time {
        // It may be gone already.
        let _ = child.kill();
    }
    let status = child.wait();
    let _ = reader.join();
    let said = listener.join().unwrap_or_default();
    let within = last_case.map_or_else(|| "before its first case".to_owned(), |case| format!("in: {case}"));
    outcome.seconds = begin.elapsed().as_secs_f64();
    outcome.ended = match status {
        _ if !in_time => Some(format!("no end after {} s, {within}", limit.as_secs_f64())),
        Ok(status) if status.success() && is_done => None,
        Ok(status) => Some(format!("{}, {within}{}", describe(status), last_of(&said))),
        Err(error) => Some(format!("its end is not known: {error}")),
    };
    outcome.passed = outcome.ended.is_none() && outcome.wrong.is_empty();
    (outcome, ground)
}

/// The status of a process that did not end well.
fn describe(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        let name = match signal {
            4 => " (SIGILL)",
            6 => " (SIGABRT)",
            7 => " (SIGBUS)",
            8 => " (SIGFPE)",
            9 => " (SIGKILL)",
            11 => " (SIGSEGV)",
            _ => "",
        };
        return format!("killed by signal {signal}{name}");
    }
    format!("ended early, {status}")
}

/// The last lines of what was said, behind a colon.
fn last_of(said: &str) -> String {
    let lines: Vec<&str> = said.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(LAST_LINES)..];
    if last.is_empty() { String::new() } else { format!(": {}", last.join(" | ")) }
}
