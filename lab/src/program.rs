//! The program `hedgerow`: its list of commands. Results go to stdout, progress and diagnostics to stderr. The exit status is 0
//! if the work is done, 1 if it failed, 2 if the arguments are wrong.

use crate::cli::{Common, build, devices, rays, render, trace};
use crate::experiments::accel::command as accel;
use crate::experiments::animate::command as animate;
use crate::experiments::bench::command as bench;
use crate::experiments::check::command as check;
use crate::experiments::choose::command as choose;
use crate::experiments::codes::command as codes;
use crate::experiments::compare::command as compare;
use crate::experiments::cpu_builders::command as cpu_builders;
use crate::experiments::fly::command as fly;
use crate::experiments::navigate::command as navigate;
use crate::experiments::predict::command as predict;
use crate::experiments::report::command as report;
use crate::experiments::stability::command as stability;
use crate::scene;
use crate::subjects::builders;
use clap::Parser;
use std::process::ExitCode;

/// Acceleration structures for ray tracing, built and traced with Vulkan compute shaders, and measured.
#[derive(Debug, Parser)]
#[command(name = "hedgerow", version, arg_required_else_help = true, after_help = after_help())]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Check(check::Arguments),
    Bench(bench::Arguments),
    CpuBuilders(cpu_builders::Arguments),
    Predict(predict::Arguments),
    Codes(codes::Arguments),
    Accel(accel::Arguments),
    Animate(animate::Arguments),
    Fly(fly::Arguments),
    Stability(stability::Arguments),
    Choose(choose::Arguments),
    Compare(compare::Arguments),
    Report(report::Arguments),
    Devices(devices::Arguments),
    Build(build::Arguments),
    Trace(trace::Arguments),
    Rays(rays::Arguments),
    Render(render::Arguments),
    Navigate(navigate::Arguments),
}

fn after_help() -> String {
    let generators = scene::generators().map(|(name, what)| format!("\n  {name:18} {what}"));
    builders::help() + SCENES + &generators.collect::<String>()
}

const SCENES: &str = "
A scene is a file (.obj, .ply, .gltf, .glb, .tri, .anim, .inst, .dyn, each also with .zst behind), the bare name of one in
scenes/ or in the folder of --scenes-dir, or a generator:";

/// Runs the command that the arguments name.
pub fn main() -> ExitCode {
    // What obvhs says of deep trees, it says of every build; usvg warns of each bar of a chart that has no width.
    let filter = "warn,obvhs=error,usvg=error";
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or(filter)).init();
    let cli = Cli::parse();
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hedgerow: {error:#}");
            ExitCode::from(if is_usage(&error) { 2 } else { 1 })
        }
    }
}

fn run(cli: &Cli) -> anyhow::Result<()> {
    let common = &cli.common;
    common.start_threads()?;
    match &cli.command {
        Command::Check(arguments) => check::run(common, arguments),
        Command::Bench(arguments) => bench::run(common, arguments),
        Command::CpuBuilders(arguments) => cpu_builders::run(common, arguments),
        Command::Predict(arguments) => predict::run(common, arguments),
        Command::Codes(arguments) => codes::run(common, arguments),
        Command::Accel(arguments) => accel::run(common, arguments),
        Command::Animate(arguments) => animate::run(common, arguments),
        Command::Fly(arguments) => fly::run(common, arguments),
        Command::Stability(arguments) => stability::run(common, arguments),
        Command::Choose(arguments) => choose::run(common, arguments),
        Command::Compare(arguments) => compare::run(common, arguments),
        Command::Report(arguments) => report::run(common, arguments),
        Command::Devices(arguments) => devices::run(common, arguments),
        Command::Build(arguments) => build::run(common, arguments),
        Command::Trace(arguments) => trace::run(common, arguments),
        Command::Rays(arguments) => rays::run(common, arguments),
        Command::Render(arguments) => render::run(common, arguments),
        Command::Navigate(arguments) => navigate::run(common, arguments),
    }
}

/// Whether the arguments are at fault rather than the work.
fn is_usage(error: &anyhow::Error) -> bool {
    let of_the_library = matches!(error.downcast_ref(), Some(hedgerow::Error::Argument(_)));
    of_the_library || error.downcast_ref().is_some_and(crate::Error::is_argument)
}

/// Whether the reader of our output has seen enough (`hedgerow devices | head -1`).
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let mut of_the_system = error.chain().filter_map(|cause| cause.downcast_ref::<std::io::Error>());
    of_the_system.any(|cause| cause.kind() == std::io::ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_arguments_are_well_formed() {
        use clap::CommandFactory;
        super::Cli::command().debug_assert();
    }

    #[test]
    fn a_number_is_what_it_is_asked_to_be() {
        use clap::Parser;
        let fov = |text: &str| super::Cli::try_parse_from(["hedgerow", "devices", "--fov", text]);
        assert_eq!(fov("60").expect("an angle").common.fov, Some(60.0));
        for wrong in ["0", "180", "nan", "-5", "x"] {
            assert!(fov(wrong).is_err(), "{wrong}");
        }
    }
}
