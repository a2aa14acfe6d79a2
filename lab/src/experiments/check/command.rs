//! `hedgerow check`: whether everything is right on this device. Each group runs in a process of its own.

use crate::cli::{Common, Json};
use crate::device::Device;
use crate::experiments::check::cases::{self, Cases, Message};
use crate::experiments::check::supervise::{self, Outcome};
use crate::experiments::check::{self, CheckRecord, Ground, Group};
use crate::report::numbers::bytes;
use anyhow::{Context, bail};
use ash::vk;
use std::io::Write;
use std::num::{NonZeroU32, NonZeroUsize};
use std::process::Command;
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Duration;

/// Seconds that a case may take: several times what the longest takes on a slow device that has to compile its shaders.
const LIMIT: &str = "240";

/// Check every builder, tracer and call on this device against host twins and brute force
///
/// Run it first on a new device. Each group runs in a process of its own, its cases under a time limit: a crash, a hang or a lost device
/// is a failed group, and the rest goes on. The last line is `N passed, M failed`; the exit status is 1 if any failed.
#[derive(Debug, clap::Args)]
#[command(after_help = after_help())]
pub struct Arguments {
    /// Try a part of the cases only, for about half a minute
    #[arg(long)]
    quick: bool,
    /// Run these groups only, separated by commas
    #[arg(long, value_name = "GROUP,…", value_delimiter = ',')]
    groups: Vec<String>,
    /// Seconds that a case may take
    #[arg(long, value_name = "SECONDS", default_value = LIMIT)]
    limit: NonZeroU32,
    /// Groups at a time [default: one a core on a device that is a CPU, of others one for four cores, which compile their kernels]
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Run one group in this process: what the command starts for each
    #[arg(long, hide = true, value_name = "GROUP")]
    run_group: Option<String>,
    #[command(flatten)]
    json: Json,
}

fn after_help() -> String {
    let groups = check::GROUPS.iter().map(|group| format!("\n  {:12} {}", group.name, group.what));
    "Groups:".to_owned() + &groups.collect::<String>()
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(name) = &arguments.run_group {
        return run_here(common, group(name)?, arguments.quick);
    }
    let chosen: Vec<&Group> = match &arguments.groups[..] {
        [] => check::groups().collect(),
        names => names.iter().map(|name| group(name)).collect::<crate::Result<_>>()?,
    };
    // A device that cannot be opened is not the fault of a group: the command itself says what is there.
    let is_cpu = common.open_device(false)?.found().kind == vk::PhysicalDeviceType::CPU;
    let cores = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let of_gpus = NonZeroUsize::new(cores.get() / 4).unwrap_or(NonZeroUsize::MIN);
    let jobs = arguments.jobs.unwrap_or(if is_cpu { cores } else { of_gpus });
    let commands = chosen.iter().map(|group| Ok((group.name, child(common, arguments, group)?)));
    let commands = commands.collect::<anyhow::Result<Vec<_>>>()?;
    let limit = Duration::from_secs(arguments.limit.get().into());
    let mut record = CheckRecord::new(arguments.quick);
    let is_shown = !arguments.json.takes_stdout();
    let show = |text: &str| if is_shown { print(text) } else { Ok(()) };
    let run = |(name, command)| supervise::run(name, command, limit);
    let tell = |(outcome, ground): (Outcome, Option<Ground>)| {
        if let Some(ground) = ground.filter(|_| record.ground.is_none()) {
            show(&head(&record, &ground))?;
            record.ground = Some(ground);
        }
        show(&line(&outcome))?;
        record.add(outcome);
        Ok(())
    };
    each_in_order(commands, jobs, run, tell)?;
    arguments.json.write_each([&record])?;
    show(&format!("{} passed, {} failed", record.passed, record.failed))?;
    if record.failed > 0 {
        bail!("{} of {} groups failed", record.failed, record.groups.len());
    }
    Ok(())
}

/// Does a number of items at a time, and reports each as soon as it and all before it are done.
fn each_in_order<T: Send, R: Send>(
    items: Vec<T>,
    jobs: NonZeroUsize,
    run: impl Fn(T) -> R + Sync,
    mut tell: impl FnMut(R) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    // A channel for each result, so that they come in order.
    let (senders, results): (Vec<_>, Vec<_>) = items.iter().map(|_| mpsc::channel()).unzip();
    let items = Mutex::new(items.into_iter().zip(senders));
    let next = || items.lock().unwrap_or_else(PoisonError::into_inner).next();
    thread::scope(|scope| {
        for _ in 0..jobs.get() {
            scope.spawn(|| {
                while let Some((item, sender)) = next() {
                    if sender.send(run(item)).is_err() {
                        return;
                    }
                }
            });
        }
        results.into_iter().flatten().try_for_each(&mut tell)
    })
}

/// Lines are for people who watch: none waits for the next.
fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{text}")?;
    Ok(out.flush()?)
}

fn group(name: &str) -> crate::Result<&'static Group> {
    check::groups().find(|group| group.name == name).ok_or_else(|| {
        let names: Vec<&str> = check::GROUPS.iter().map(|group| group.name).collect();
        crate::Error::Argument(format!("unknown group {name:?}; use some of {}", names.join(", ")))
    })
}

/// This program with the same options, for one group.
fn child(common: &Common, arguments: &Arguments, group: &Group) -> anyhow::Result<Command> {
    let mut command = supervise::this_program().context("the program's own file is not known")?;
    command.args(["check", "--run-group", group.name, "--tuning", &common.tuning.to_string()]);
    if let Some(device) = common.device() {
        command.args(["--device", device]);
    }
    if let Some(threads) = common.threads {
        command.args(["--threads", &threads.to_string()]);
    }
    command.args(common.validation.then_some("--validation"));
    command.args(arguments.quick.then_some("--quick"));
    Ok(command)
}

/// One group in this process: what it finds goes to stdout, a message a line. The device lives as long as the process, which ends
/// with its group.
fn run_here(common: &Common, group: &Group, quick: bool) -> anyhow::Result<()> {
    let device: &'static Device = Box::leak(Box::new(common.open_device(false)?));
    let mut tell = |message: Message| {
        let text = serde_json::to_string(&message).expect("a message has no keys but strings");
        // Nobody is left to hear it: then nothing is left to do, either.
        if print(&text).is_err() {
            std::process::exit(1);
        }
    };
    cases::keep_panics();
    tell(Message::Ground(Ground::of(device, common.tuning)));
    (group.run)(&mut Cases::new(device, quick, &mut tell));
    tell(Message::Done);
    Ok(())
}

fn head(record: &CheckRecord, ground: &Ground) -> String {
    let limits = &ground.limits;
    let tuning = match ground.tuning == ground.tuned_as {
        true => ground.tuning.clone(),
        false => format!("{}: as for a {}", ground.tuning, ground.tuned_as.to_uppercase()),
    };
    format!(
        "hedgerow {}, commit {}, {}{}\n\
         device   {}\n\
         driver   {}, Vulkan {}\n\
         limits   subgroups of {}, workgroups of {}, {} workgroups a dispatch, {} of shared memory, {} of device memory\n\
         tuning   {tuning}\n",
        env!("CARGO_PKG_VERSION"),
        record.commit,
        record.when,
        if record.quick { ", quick" } else { "" },
        ground.device,
        ground.driver,
        ground.vulkan,
        limits.subgroup_size,
        limits.workgroup_invocations,
        limits.workgroup_count,
        bytes(limits.shared_memory.into()),
        bytes(limits.memory),
    )
}

/// A group's line, and what is wrong below it.
fn line(outcome: &Outcome) -> String {
    let Outcome { group, passed, seconds, cases, wrong, left_out, ended } = outcome;
    let verdict = if *passed { "passed" } else { "FAILED" };
    let mut text = format!("{verdict}   {group:12} {seconds:6.1} s {cases:5} cases");
    for what in left_out {
        text += &format!("\n         left out: {what}");
    }
    for difference in wrong {
        text += &format!("\n         {}: {}", difference.case, difference.what);
    }
    if let Some(ended) = ended {
        text += &format!("\n         {ended}");
    }
    text
}
