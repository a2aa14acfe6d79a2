//! The rate of a plain copy: a figure that a memory can have.

#[test]
fn a_plain_copy_runs_at_the_rate_of_some_memory() {
    let rate = hedgerow_lab::measure::copy::rate_gb_s(crate::common::device()).expect("the device copies");
    // From a loaded core under validation to several stacks of HBM.
    assert!((0.05..20_000.0).contains(&rate), "{rate} GB/s");
}
