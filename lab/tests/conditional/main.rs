//! The tests that need what a machine may lack: real scenes, a browser, minutes. See [`conditional`].

mod browser;
#[path = "../../../tests/common/mod.rs"]
mod common;
mod conditional;
#[path = "../files.rs"]
mod files;
mod pages;

mod bvh_determinism;
mod bvh_frantal_costs;
mod bvh_growth;
mod bvh_reference_costs;
mod cli;
mod driver;
mod flights;
mod navigate;
mod report_accel;
mod report_animate;
mod report_cpu_builders;
mod report_page;
mod report_stability;
mod scene_shared;
mod stability_figures;
mod tuning;

fn main() -> std::process::ExitCode {
    conditional::run(vec![
        ("bvh_determinism", bvh_determinism::tests()),
        ("bvh_frantal_costs", bvh_frantal_costs::tests()),
        ("bvh_growth", bvh_growth::tests()),
        ("bvh_reference_costs", bvh_reference_costs::tests()),
        ("cli", cli::tests()),
        ("driver", driver::tests()),
        ("flights", flights::tests()),
        ("navigate", navigate::tests()),
        ("report_accel", report_accel::tests()),
        ("report_animate", report_animate::tests()),
        ("report_cpu_builders", report_cpu_builders::tests()),
        ("report_page", report_page::tests()),
        ("report_stability", report_stability::tests()),
        ("scene_shared", scene_shared::tests()),
        ("stability_figures", stability_figures::tests()),
        ("tuning", tuning::tests()),
    ])
}
