//! The tests of the library and of `hedgerow-host`, on the laboratory's device: a folder for each room.

mod common;
mod device_limits;
mod drivers;
mod engine;
mod engines;
mod flux_rounds;
mod formats;
mod house;
mod linked;
#[path = "../build/reflection.rs"]
mod reflection;
mod shader_features;
mod warming;

mod accel {
    mod arguments;
    mod bad;
    mod blas;
    mod boxes;
    mod checked;
    mod child_order;
    mod copy;
    mod empty;
    mod facing;
    mod far;
    mod host;
    mod indirect;
    mod instances;
    mod link_counts;
    mod memory;
    mod rays;
    mod rebraid;
    mod threads;
    mod tlas;
    mod update;
    mod watertight;
}

mod bvh {
    mod child_order;
    mod codes;
    mod epo;
    mod geometry;
    mod heuristics;
    mod host;
    mod lbvh;
    mod limits;
    mod methods;
    mod pairs;
    mod refit;
    mod reinsertion;
    mod split;
    mod wide;
    mod wide_costs;
}

mod gpu {
    mod radix_sort;
    mod scan_reduce;
}

mod kdtree {
    mod device;
    mod host;
    mod merge;
    mod merge_cost;
    mod merge_device;
    mod merge_device_cost;
}

mod trace {
    mod counts;
    mod device;
    mod flux;
    mod host;
    mod kd;
    mod kd_device;
    mod trial;
    mod wide;
}
