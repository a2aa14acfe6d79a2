//! Reinsertion: the device's bytes are the host's; trees stay valid and never become worse.

use crate::common::{corpus, device};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::{Bvh2, MAX_DEPTH};
use hedgerow::bvh::reinsertion::{Reinsertion, ReinsertionOptions};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::quality;
use hedgerow::bvh::twin::{lbvh, ploc};

/// The LBVH and PLOC of every mesh, with one triangle a leaf.
fn trees() -> impl Iterator<Item = (String, Bvh2)> {
    let large = [corpus::random("20,000 random", 20_000, [0.0; 3], [1.0; 3])];
    corpus::meshes().into_iter().chain(large).flat_map(|(name, positions, triangles)| {
        let lbvh = lbvh::build(&positions, &triangles, Code::Mc30.full(), Collapse::OFF);
        let ploc = ploc::build(&lbvh, 4);
        [(format!("LBVH, {name}"), lbvh), (format!("PLOC, {name}"), ploc)]
    })
}

/// Few links a round, every link, and a stride that all of them take.
const OPTIONS: [ReinsertionOptions; 3] = [
    ReinsertionOptions::FAST,
    ReinsertionOptions { rounds: 4, stride: 1 },
    ReinsertionOptions { rounds: 12, stride: 5 },
];

/// Cost of the steps: what reinsertion lessens.
fn area(tree: &Bvh2) -> f64 {
    quality::of(tree, 1.0, 0.0).sah
}

#[test]
fn optimised_trees_are_valid_with_the_same_records_and_never_worse() {
    for (name, tree) in trees() {
        for options in OPTIONS {
            let optimised = tree.reinserted(&options);
            assert!(optimised.records == tree.records, "{name}: other records");
            assert_eq!(optimised.header, tree.header, "{name}");
            if quality::of(&optimised, 1.0, 0.0).depth_max <= MAX_DEPTH {
                optimised.validate().unwrap_or_else(|e| panic!("{name} {options:?}: {e}"));
            }
            for collapse in [Collapse::SAH, Collapse::OFF] {
                optimised.collapsed(&collapse).validate().unwrap_or_else(|e| panic!("{name} {options:?}: {e}"));
            }
            let (before, after) = (area(&tree), area(&optimised));
            assert!(after <= before * (1.0 + 1e-6), "{name} {options:?}: {before} became {after}");
        }
    }
}

/// Sixty-four cells of sixteen triangles in any order, against a tree that knows where each lies.
#[test]
fn a_tree_that_is_bad_below_becomes_better_than_a_good_one() {
    let (_, positions, triangles) = corpus::random("random 1023", 1023, [0.0; 3], [1.0; 3]);
    let lbvh = |bits| lbvh::build(&positions, &triangles, Code::Mc30.full().with_bits(bits), Collapse::OFF);
    let (bad, good) = (lbvh(6), ploc::build(&lbvh(30), 25));
    let optimised = bad.reinserted(&ReinsertionOptions::HIGH);
    assert!(area(&bad) > 1.3 * area(&good), "{} is not bad against {}", area(&bad), area(&good));
    assert!(area(&optimised) < area(&good), "{} against {}", area(&optimised), area(&good));
}

#[test]
fn the_device_gives_the_bytes_of_the_host_and_touches_nothing_else() {
    const GUARD: [u8; 256] = [0xA5; 256];
    let device = device();
    for (name, tree) in trees() {
        for options in OPTIONS {
            let reinsertion = Reinsertion::new(device, &options, tree.header.primitive_count);
            let bytes = tree.to_bytes();
            let structure = device.upload("structure", &[&bytes[..], &GUARD].concat()).unwrap();
            let scratch_bytes = reinsertion.scratch_bytes();
            let scratch =
                device.upload("scratch", &[vec![0xFF; scratch_bytes as usize], GUARD.to_vec()].concat()).unwrap();
            device.run(None, |r| reinsertion.record(r, structure.region(), scratch.region())).unwrap();
            let got = structure.read::<u8>(bytes.len());
            assert!(got == tree.reinserted(&options).to_bytes(), "{name} {options:?}: other bytes");
            assert_eq!(
                structure.read_at::<u8>(bytes.len() as u64, GUARD.len()),
                GUARD,
                "{name}: wrote behind the structure"
            );
            assert_eq!(
                scratch.read_at::<u8>(scratch_bytes, GUARD.len()),
                GUARD,
                "{name}: wrote behind the scratch memory"
            );
        }
    }
}
