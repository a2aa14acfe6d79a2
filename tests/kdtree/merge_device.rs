//! Objects merged on the device give the bytes of the host, and are out again without a trace.

use crate::common::corpus::{self, Mesh};
use crate::common::device;
use crate::common::shapes::{Corners, hard_rays, icosphere, placed, soup, tree_of};
use crate::common::twins::PLENTY_TO_MERGE;
use hedgerow::bvh::builder::Input;
use hedgerow::bvh::layout::status;
use hedgerow::kdtree::builder::{self, KdBuilder, KdSchedule};
use hedgerow::kdtree::layout::{KdHeader, KdTree, SpareRoom};
use hedgerow::kdtree::merge::{
    MergeCapacity, MergeEstimate, MergeMemory, MergeOptions, MergeReport, Merger, Object, Objects,
};
use hedgerow::kdtree::twin;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd as kd_host;
use hedgerow::trace::twin::tracer::closest_hit;
use hedgerow_lab::device::Buffer;
use hedgerow_lab::random::SplitMix64;

const PLENTY: MergeOptions = MergeOptions { build: builder::KdOptions::DEFAULT, estimate: PLENTY_TO_MERGE };

/// As a chain, and by persistent workgroups.
fn schedules() -> impl Iterator<Item = MergeOptions> {
    let persistent = [1, 2, 7, 64, 1024].map(|workgroups| builder::KdOptions {
        schedule: Some(KdSchedule::Persistent),
        workgroups: Some(workgroups),
        ..PLENTY.build
    });
    let chain = builder::KdOptions { schedule: Some(KdSchedule::Chain), ..PLENTY.build };
    [chain].into_iter().chain(persistent).map(|build| MergeOptions { build, ..PLENTY })
}

/// Static triangles and objects, numbered one after the other.
struct World {
    name: &'static str,
    still: Corners,
    objects: Vec<Corners>,
}

impl World {
    fn most(&self) -> MergeCapacity {
        MergeCapacity {
            objects: self.objects.len() as u32,
            triangles: self.objects.iter().map(|object| object.len() as u32).sum(),
        }
    }
}

fn worlds() -> Vec<World> {
    let sphere = |scale: f32, at: [f32; 3]| placed(&icosphere(3), scale, at);
    let flat = |z: f32| vec![[[-0.4, -0.4, z], [0.5, -0.4, z], [-0.4, 0.5, z]], [[0.0, 0.0, z]; 3], [[f32::NAN; 3]; 3]];
    let world = |name, still, objects| World { name, still, objects };
    vec![
        world("one in a soup", soup(3000, 0.1, 1), vec![sphere(0.3, [0.1, 0.2, 0.3])]),
        world("overlapping", soup(500, 0.2, 2), vec![sphere(0.3, [0.1; 3]), soup(300, 0.3, 3), sphere(0.2, [0.2; 3])]),
        world("outside", sphere(0.5, [0.0; 3]), vec![sphere(0.5, [2.0, 0.1, 0.0]), sphere(0.1, [-0.2, -3.0, 0.0])]),
        world("in empty space", sphere(1.0, [0.0; 3]), vec![sphere(0.1, [0.0; 3]), sphere(0.05, [0.3, 0.3, 0.3])]),
        world(
            "degenerate",
            soup(200, 0.2, 4),
            vec![flat(0.0), vec![[[f32::INFINITY; 3]; 3]], vec![[[0.25; 3]; 3]; 50]],
        ),
        world("nothing still", Vec::new(), vec![sphere(0.5, [0.0; 3]), soup(100, 0.2, 5)]),
        world("one still", soup(1, 0.5, 6), vec![soup(100, 0.5, 7)]),
        world("nothing moves", soup(100, 0.2, 8), vec![Vec::new(), Vec::new()]),
        world("large in small", sphere(0.5, [0.0; 3]), vec![soup(40, 5.0, 9)]),
        world("the same twice", sphere(0.5, [0.0; 3]), vec![sphere(0.5, [0.0; 3])]),
    ]
}

/// The same with a static tree, and all in device memory.
struct Scene {
    still: KdTree,
    structure: Buffer<'static>,
    scratch: Buffer<'static>,
    undo: Buffer<'static>,
    meshes: Vec<(u32, Mesh, Object)>,
    /// What the objects lie in.
    _buffers: Vec<Buffer<'static>>,
    merger: Merger,
}

impl Scene {
    fn new(world: &World, options: &MergeOptions) -> Scene {
        let (_, positions, triangles) = corpus::soup("", world.still.clone());
        let still = twin::builder::build(&positions, &triangles, &builder::KdOptions::DEFAULT).expect("a static tree");
        Scene::with(still, world, options)
    }

    fn with(still: KdTree, world: &World, options: &MergeOptions) -> Scene {
        let most = world.most();
        let still = still.with_room(Merger::room(options, most)).expect("room");
        let merger = Merger::new(device(), options, &still.header, most).expect("a merger");
        let sizes = merger.sizes();
        let buffer = |name: &str, bytes: u64| {
            let buffer = device().buffer(name, bytes).expect("memory");
            buffer.write(&vec![0xA5u8; bytes as usize]);
            buffer
        };
        let bytes = still.to_bytes();
        let structure = buffer("structure", bytes.len() as u64);
        structure.write(&bytes);
        let (mut meshes, mut buffers) = (Vec::new(), Vec::new());
        let mut first_primitive = still.header.primitive_count;
        for corners in &world.objects {
            let mesh = corpus::soup("object", corners.clone());
            let upload = |name: &str, bytes: &[u8]| {
                let buffer = buffer(name, bytes.len().max(16) as u64);
                buffer.write(bytes);
                buffer
            };
            let vertices = upload("positions", bytemuck::cast_slice(&mesh.1));
            let indices = upload("indices", bytemuck::cast_slice(&mesh.2));
            let count = mesh.2.len() as u32;
            let input = Input::mesh(vertices.address(), mesh.1.len() as u32, indices.address(), count);
            meshes.push((first_primitive, mesh, Object { input, first_primitive, tree: None }));
            first_primitive += count;
            buffers.extend([vertices, indices]);
        }
        let (scratch, undo) = (buffer("scratch", sizes.scratch), buffer("undo", sizes.undo));
        Scene { still, structure, scratch, undo, meshes, _buffers: buffers, merger }
    }

    fn memory(&self) -> MergeMemory {
        MergeMemory { structure: self.structure.region(), scratch: self.scratch.region(), undo: self.undo.region() }
    }

    fn merge(&self, objects: &[Object]) -> MergeReport {
        device().run(None, |recorder| self.merger.record(recorder, self.memory(), objects)).expect("a merge");
        self.scratch.read_at(self.merger.report_range().start, 1)[0]
    }

    fn restore(&self) {
        device().run(None, |recorder| self.merger.restore(recorder, self.memory())).expect("a restore");
    }

    fn tree(&self) -> KdTree {
        let bytes = self.still.header.offsets().bytes;
        KdTree::from_bytes(&self.structure.read::<u8>(bytes as usize)).expect("a kd-tree")
    }

    /// Merged, it is the tree expected; restored, the one that was there.
    #[track_caller]
    fn assert_in_and_out(&self, objects: &[Object], expected: &KdTree, what: &str) {
        let before = self.tree().to_bytes();
        let report = self.merge(objects);
        assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{what}: {report:?}");
        assert_same(&self.tree(), expected, what);
        self.restore();
        assert!(self.tree().to_bytes() == before, "{what}: the static tree is another");
    }

    fn objects(&self, which: impl Fn(usize) -> bool) -> Vec<Object> {
        (0..self.meshes.len()).filter(|&i| which(i)).map(|i| self.meshes[i].2).collect()
    }

    /// Kd-trees of the objects, built on the device.
    fn trees(&self) -> Vec<Buffer<'static>> {
        let tree = |(_, _, object): &(u32, Mesh, Object)| {
            let builder = KdBuilder::new(device(), &builder::KdOptions::DEFAULT, object.input.primitive_count)
                .expect("a builder");
            let sizes = builder.sizes();
            let [structure, scratch] =
                [sizes.structure, sizes.scratch].map(|bytes| device().buffer("tree", bytes).expect("memory"));
            device()
                .run(None, |recorder| builder.record(recorder, &object.input, structure.region(), scratch.region()))
                .expect("a build");
            structure
        };
        self.meshes.iter().map(tree).collect()
    }

    /// All objects, of which those of these numbers are pushed as trees.
    fn pushed(&self, trees: &[Buffer<'_>], which: impl Fn(usize) -> bool) -> Vec<Object> {
        let pushed =
            |(i, tree): (usize, &Buffer<'_>)| Object { tree: which(i).then(|| tree.address()), ..self.meshes[i].2 };
        trees.iter().enumerate().map(pushed).collect()
    }

    fn on_host(&self, which: impl Fn(usize) -> bool) -> KdTree {
        let object = |i: usize| {
            let (first_primitive, (_, positions, triangles), _) = &self.meshes[i];
            twin::merge::HostObject { first_primitive: *first_primitive, positions, triangles }
        };
        let objects: Vec<_> = (0..self.meshes.len()).filter(|&i| which(i)).map(object).collect();
        let builder::KdOptions { bins, exact, costs, .. } = builder::KdOptions::DEFAULT;
        twin::merge::merge(&self.still, &objects, costs, (bins, exact)).expect("a merged tree")
    }
}

fn without_room(header: &KdHeader) -> KdHeader {
    KdHeader { node_room: 0, reference_room: 0, record_room: 0, ..*header }
}

#[track_caller]
fn assert_same(got: &KdTree, expected: &KdTree, what: &str) {
    assert_eq!(without_room(&got.header), without_room(&expected.header), "{what}: header");
    let differs = got.nodes.iter().zip(&expected.nodes).position(|(a, b)| a != b);
    assert_eq!(differs, None, "{what}: {:?}", differs.map(|i| (got.nodes[i].content(), expected.nodes[i].content())));
    assert_eq!(got.references, expected.references, "{what}: references");
    assert_eq!(got.records, expected.records, "{what}: records");
}

#[test]
fn a_merge_gives_the_bytes_of_the_host_and_a_restore_those_of_the_static_tree() {
    for world in worlds() {
        let scene = Scene::new(&world, &PLENTY);
        for which in [0b1u32, 0b11, 0b101, 0b111] {
            let which = |i: usize| which >> i & 1 == 1;
            let expected = scene.on_host(which);
            expected.validate().unwrap_or_else(|error| panic!("{}: {error}", world.name));
            // In any order.
            let mut objects = scene.objects(which);
            objects.reverse();
            scene.assert_in_and_out(&objects, &expected, world.name);
        }
        let header = scene.still.header;
        let raw = scene.structure.read::<u8>(header.offsets().bytes as usize);
        let counted = 128 + 8 * header.node_count as usize;
        assert!(raw[..counted] == scene.still.to_bytes()[..counted], "{}: raw bytes", world.name);
    }
}

#[test]
fn objects_that_are_pushed_as_trees_give_the_same_bytes_as_those_that_find_their_leaves() {
    // Squares in planes that static ones lie in too, and edges whose ends no difference tells.
    let squares = |at: f32, count: i32| {
        let square = |i: i32| {
            let [x, y] = [i % count, i / count].map(|k| at + 0.25 * k as f32);
            [[[x, y, at], [x + 0.25, y, at], [x, y + 0.25, at]], [[at, x, y], [at, x, y + 0.25], [at, x + 0.25, y]]]
        };
        (0..count * count).flat_map(square).collect::<Corners>()
    };
    // A long triangle is in leaves that begin beside it, farther off than the cell of its own tree reaches.
    let beside = |p: [f32; 3]| [p[0], p[1], 1.2e-4 + (p[2].abs() - 0.3).max(0.0)];
    let mut above: Corners = soup(20, 0.1, 14).iter().map(|t| t.map(beside)).collect();
    above.push([[-1.0, -1.0, -1.0], [-0.9, -1.0, -1.0], [-1.0, -0.9, -1.0]]);
    let long = vec![[[-8.0, -8.0, 0.0], [8.0, -8.0, 0.0], [-8.0, 8.0, 0.0]]];
    let more = [
        World { name: "beside", still: above, objects: vec![long, soup(20, 0.1, 15)] },
        World {
            name: "in planes",
            still: squares(0.0, 8),
            objects: vec![squares(0.0, 3), squares(0.5, 4), squares(0.375, 4)],
        },
        World {
            name: "too long",
            still: soup(50, 0.2, 10),
            objects: vec![
                placed(&soup(20, 1.0, 11), 1.5e38, [0.0; 3]),
                soup(50, 0.2, 12),
                placed(&soup(20, 1.0, 13), 1e30, [0.0; 3]),
            ],
        },
    ];
    for world in worlds().into_iter().chain(more) {
        let scene = Scene::new(&world, &PLENTY);
        let expected = scene.on_host(|_| true);
        let trees = scene.trees();
        for which in [0b000u32, 0b111, 0b010, 0b101] {
            let what = format!("{}, pushed {which:03b}", world.name);
            scene.assert_in_and_out(&scene.pushed(&trees, |i| which >> i & 1 == 1), &expected, &what);
        }
    }
}

#[test]
fn chains_and_any_number_of_persistent_workgroups_give_the_same_bytes() {
    for world in worlds() {
        let expected = Scene::new(&world, &PLENTY).on_host(|_| true);
        for options in schedules() {
            let scene = Scene::new(&world, &options);
            let trees = scene.trees();
            for which in [0b000u32, 0b101] {
                let builder::KdOptions { schedule, workgroups, .. } = options.build;
                let what = format!("{}, {schedule:?}, {workgroups:?} workgroups, pushed {which:03b}", world.name);
                scene.assert_in_and_out(&scene.pushed(&trees, |i| which >> i & 1 == 1), &expected, &what);
            }
        }
    }
}

/// The object's tree in the same command buffer, ahead of the merge.
#[test]
fn a_tree_can_be_built_and_pushed_at_once() {
    let world = &worlds()[0];
    let scene = Scene::new(world, &PLENTY);
    let object = scene.meshes[0].2;
    let builder =
        KdBuilder::new(device(), &builder::KdOptions::DEFAULT, object.input.primitive_count).expect("a builder");
    let sizes = builder.sizes();
    let [tree, scratch] = [sizes.structure, sizes.scratch].map(|bytes| device().buffer("tree", bytes).expect("memory"));
    device()
        .run(None, |recorder| {
            builder.record(recorder, &object.input, tree.region(), scratch.region())?;
            recorder.barrier();
            scene.merger.record(recorder, scene.memory(), &[Object { tree: Some(tree.address()), ..object }])
        })
        .expect("a build and a merge");
    assert_same(&scene.tree(), &scene.on_host(|_| true), "built and pushed");
}

#[test]
fn hits_of_a_merged_tree_are_those_of_brute_force() {
    for world in worlds() {
        let scene = Scene::new(&world, &PLENTY);
        scene.merge(&scene.objects(|_| true));
        let tree = scene.tree();
        let all: Corners = world.still.iter().chain(world.objects.iter().flatten()).copied().collect();
        if all.iter().flatten().flatten().any(|x| !x.is_finite()) {
            continue;
        }
        let bvh = tree_of(&all);
        for ray in hard_rays(&all, 3000, 1.5, [0.1; 3], 7) {
            let (got, expected) = (kd_host::closest_hit(&tree, &ray, Traversal::STACK), closest_hit(&bvh, &ray));
            assert_eq!((got.t, got.primitive), (expected.t, expected.primitive), "{}: {ray:?}", world.name);
        }
    }
}

/// Objects come and go at random, merged by the schedules in turn; now and then the tree is looked at.
fn rounds(count: u32, look: u32) {
    let sphere = placed(&icosphere(1), 0.2, [0.0; 3]);
    let mut random = SplitMix64::new(11);
    let objects = (0..6).map(|_| placed(&sphere, 1.0, random.around(0.6))).collect();
    let world = World { name: "rounds", still: soup(300, 0.2, 12), objects };
    let mut scene = Scene::new(&world, &PLENTY);
    let before = scene.tree().to_bytes();
    let merger = |options| Merger::new(device(), &options, &scene.still.header, world.most()).expect("a merger");
    let mergers: Vec<Merger> = schedules().map(merger).collect();
    let scratch = mergers.iter().map(|merger| merger.sizes().scratch).max().expect("schedules");
    scene.scratch = device().buffer("scratch", scratch).expect("memory");
    let mut there = Objects::default();
    let mut is_there = [false; 6];
    for round in 0..count {
        let object = (random.bits() % 6) as usize;
        let name = object.to_string();
        if is_there[object] {
            assert_eq!(there.take_out(&name).expect("it is there"), scene.meshes[object].2);
        } else {
            there.insert(&name, scene.meshes[object].2).expect("it is not there");
        }
        is_there[object] ^= true;
        scene.merger = mergers[round as usize % mergers.len()].clone();
        scene.merge(&there.list());
        if round % look == 0 {
            let tree = scene.tree();
            tree.validate().unwrap_or_else(|error| panic!("round {round}: {error}"));
            assert_same(&tree, &scene.on_host(|i| is_there[i]), &format!("round {round}"));
        }
        scene.restore();
        if round % look == 0 {
            assert!(scene.tree().to_bytes() == before, "round {round}: the static tree is another");
        }
    }
    assert!(scene.tree().to_bytes() == before);
}

#[test]
fn objects_come_and_go() {
    rounds(200, 3);
}

#[test]
#[ignore = "ten thousand merges on the device take two minutes; the same with 200 rounds is not ignored"]
fn objects_come_and_go_ten_thousand_times() {
    rounds(10_000, 50);
}

/// A static tree that the device has built, with room for more.
#[test]
fn what_the_device_builds_can_be_merged_into() {
    let world = &worlds()[0];
    let most = MergeCapacity { objects: 1, triangles: world.objects[0].len() as u32 };
    let (_, positions, triangles) = corpus::soup("still", world.still.clone());
    let more = Merger::room(&PLENTY, most);
    let options = builder::KdOptions { more, ..builder::KdOptions::DEFAULT };
    let count = triangles.len() as u32;
    let builder = KdBuilder::new(device(), &options, count).expect("a builder");
    let sizes = builder.sizes();
    let structure = device().buffer("structure", sizes.structure).expect("memory");
    let scratch = device().buffer("scratch", sizes.scratch).expect("memory");
    let vertices = device().upload("positions", &positions).expect("memory");
    let indices = device().upload("indices", &triangles).expect("memory");
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), count);
    device()
        .run(None, |recorder| builder.record(recorder, &input, structure.region(), scratch.region()))
        .expect("a build");
    let still = KdTree::from_bytes(&structure.read::<u8>(sizes.structure as usize)).expect("a kd-tree");
    let header = still.header;
    let room = SpareRoom {
        nodes: header.node_room - header.node_count,
        references: header.reference_room - header.reference_count,
        records: header.record_room - header.active,
    };
    assert!(room.nodes >= more.nodes && room.references >= more.references && room.records == more.records);
    assert_eq!(
        (header.node_room, header.reference_room, header.record_room),
        (builder.header().node_room, builder.header().reference_room, builder.header().record_room)
    );
    let scene = Scene::with(still, world, &PLENTY);
    scene.merge(&scene.objects(|_| true));
    assert_same(&scene.tree(), &scene.on_host(|_| true), "a tree of the device");
}

/// Whatever there is too little of, the tree is valid, the status says so, and the report leads to what suffices.
#[test]
fn what_is_out_of_room_is_told() {
    let world = &worlds()[0];
    let enough = Scene::new(world, &PLENTY);
    let trees = enough.trees();
    // Trees are of the triangles, wherever these lie.
    let report = enough.merge(&enough.pushed(&trees, |_| true));
    let expected = enough.on_host(|_| true);
    let triangles = world.objects[0].len() as u32;
    let exact = report.estimate(triangles);
    let fields: [fn(&mut MergeEstimate) -> &mut f32; 9] = [
        |e| &mut e.pairs,
        |e| &mut e.items,
        |e| &mut e.marked,
        |e| &mut e.build.level_references,
        |e| &mut e.build.level_nodes,
        |e| &mut e.build.subtree_nodes,
        |e| &mut e.build.cut_references,
        |e| &mut e.build.subtree_references,
        |e| &mut e.build.subtrees,
    ];
    for (number, field) in fields.into_iter().enumerate() {
        for factor in [0.9, 0.5, 0.0] {
            let mut options = MergeOptions { estimate: exact, ..PLENTY };
            *field(&mut options.estimate) *= factor;
            for attempt in 0.. {
                let what = format!("field {number} × {factor}, attempt {attempt}");
                let scene = Scene::new(world, &options);
                let before = scene.tree().to_bytes();
                let report = scene.merge(&scene.pushed(&trees, |_| true));
                let tree = scene.tree();
                tree.validate().unwrap_or_else(|error| panic!("{what}: {error}"));
                assert_eq!(tree.header.status, report.status, "{what}");
                if report.status & status::OUT_OF_ROOM == 0 {
                    assert_same(&tree, &expected, &what);
                    break;
                }
                scene.restore();
                assert!(scene.tree().to_bytes() == before, "{what}: the static tree is another");
                assert!(attempt < 8, "{what}: {report:?}");
                options.estimate = report.estimate(triangles);
            }
        }
    }
}

#[test]
fn what_cannot_be_merged_is_refused_by_name() {
    let world = &worlds()[1];
    let scene = Scene::new(world, &PLENTY);
    let error_of = |objects: &[Object]| {
        device()
            .run(None, |recorder| scene.merger.record(recorder, scene.memory(), objects))
            .expect_err("refused")
            .to_string()
    };
    let [a, b, _] = scene.objects(|_| true)[..] else { panic!("three objects") };
    assert!(error_of(&[a, b, a, b]).contains("4 objects of"));
    assert!(error_of(&[a, a]).contains("number them apart"));
    assert!(error_of(&[Object { tree: Some(8), ..a }]).contains("a multiple of 16"));
    assert!(error_of(&[Object { first_primitive: 3, ..a }]).contains("those before end at 500"));
    let small = KdHeader { node_room: 5, ..scene.still.header };
    let error =
        Merger::new(device(), &PLENTY, &small, MergeCapacity { objects: 1, triangles: 100 }).expect_err("too small");
    assert!(error.to_string().contains("room for 5 nodes"), "{error}");
    let mut objects = Objects::default();
    objects.insert("ball", a).expect("new");
    assert!(objects.insert("ball", b).expect_err("twice").to_string().contains("\"ball\" is in the tree already"));
    let error = objects.take_out("bell").expect_err("never inserted").to_string();
    assert!(error.contains("\"bell\" was never inserted") && error.contains("ball"), "{error}");
}
