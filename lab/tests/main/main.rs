//! The tests of the laboratory.

#[path = "../../../tests/common/mod.rs"]
mod common;
#[path = "../files.rs"]
mod files;

mod accel_command;
mod animate;
mod bench;
mod build_command;
mod check;
mod choose;
mod codes_command;
mod contract;
mod cpu_builders;
mod cpu_peers;
mod fly;
mod gpu_reciprocal;
mod gpu_task_pool;
mod host_records;
mod measure_copy;
mod predict_command;
mod program;
mod scene_dynamic;
mod scene_files;
mod scene_generators;
mod scene_gltf;
mod scene_inst;
mod scene_instances;
mod scene_obj;
mod scene_own;
mod scene_ply;
mod shards;
mod stability_command;
mod trace_kinds;
