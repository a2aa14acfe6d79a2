//! What merging costs beside rebuilding, and what tracing the merged tree does beside two trees: prints the figures of
//! docs/notes/kdtree.md. Needs the scenes of HEDGEROW_SCENES and minutes:
//!
//! `cargo test --release --test kdtree_merge_cost -- --ignored --nocapture`

use hedgerow::kdtree::layout::{KdTree, SpareRoom};
use hedgerow::kdtree::quality;
use hedgerow::kdtree::termination::Costs;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::twin::kd::trace;
use hedgerow::trace::{Hit, Query, Ray};
use hedgerow_host::kdtree::merge::Merged;
use hedgerow_host::kdtree::{HostKdOptions, build};
use hedgerow_lab::rays::kinds::{self, RayKind, RayOptions};
use hedgerow_lab::scene::{DynamicScene, LoadOptions, Mesh, Scene, load_dynamic, own_folders};
use std::hint::black_box;
use std::time::Instant;

const ROUNDS: usize = 7;
const TRACES: usize = 9;
const ROOM: SpareRoom = SpareRoom { nodes: 1 << 22, references: 1 << 22, records: 1 << 20 };

/// Milliseconds.
fn timed<T>(times: &mut Vec<f64>, what: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = what();
    times.push(1e3 * start.elapsed().as_secs_f64());
    result
}

fn median(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// The nearest hit in two trees, of which the second numbers its primitives from `first` on; and the steps and tests.
fn trace_two(trees: [&KdTree; 2], first: u32, ray: &Ray, query: Query) -> (Hit, [u64; 2]) {
    let (a, work_a) = trace(trees[0], ray, query, Traversal::STACK);
    let mut work = [u64::from(work_a.steps), u64::from(work_a.tests)];
    if query == Query::AnyHit && a.is_some() {
        return (a, work);
    }
    // Equally near hits of the second tree have the greater index.
    let t_max = if a.is_some() { a.t } else { ray.t_max };
    let (b, work_b) = trace(trees[1], &Ray { t_max, ..*ray }, query, Traversal::STACK);
    work = [work[0] + u64::from(work_b.steps), work[1] + u64::from(work_b.tests)];
    let hit = if b.is_some() { Hit { primitive: b.primitive + first, ..b } } else { a };
    (hit, work)
}

fn rays_of(scene: &Scene, kind: RayKind, tree: &KdTree) -> Vec<Ray> {
    let options = RayOptions { size: [160, 120], seed: 1 };
    let mut closest =
        |rays: &[Ray]| Ok(rays.iter().map(|r| trace(tree, r, Query::ClosestHit, Traversal::STACK).0).collect());
    kinds::generate(kind, scene, &options, &mut closest).expect("rays")
}

/// A dynamic scene at a time: the static tree, and objects with their first primitives.
struct World {
    scene: Scene,
    still: KdTree,
    objects: Vec<(String, u32, Mesh)>,
}

impl World {
    fn of(scene: &DynamicScene, time: f32) -> World {
        let Mesh { positions, triangles } = &scene.static_mesh;
        let objects = scene.objects.iter().zip(scene.primitives());
        World {
            scene: scene.at(time).expect("finite"),
            still: build(positions, triangles, &HostKdOptions::EXACT)
                .and_then(|tree| tree.with_room(ROOM))
                .expect("room"),
            objects: objects
                .map(|(object, primitives)| {
                    let mesh = Mesh { positions: object.placed(time), triangles: object.triangles.clone() };
                    (object.name.clone(), primitives.start as u32, mesh)
                })
                .collect(),
        }
    }

    /// Of all triangles from one on.
    fn tree_from(&self, first: u32) -> KdTree {
        let Mesh { positions, triangles } = &self.scene.mesh;
        build(positions, &triangles[first as usize..], &HostKdOptions::BINNED).expect("a tree")
    }

    fn trees(&self) -> Vec<KdTree> {
        let tree = |mesh: &Mesh| build(&mesh.positions, &mesh.triangles, &HostKdOptions::BINNED).expect("a tree");
        self.objects.iter().map(|(.., mesh)| tree(mesh)).collect()
    }

    fn insert(&self, trees: Vec<KdTree>, merged: &mut Merged) {
        for ((name, first, ..), tree) in self.objects.iter().zip(trees) {
            merged.insert(name, *first, tree).expect("apart");
        }
    }
}

/// Rebuilding, building the objects' trees, merging and restoring, in turn.
fn measure_building(world: &World, merged: &mut Merged) {
    let mut times = [(); 4].map(|()| Vec::new());
    for _ in 0..ROUNDS {
        timed(&mut times[0], || world.tree_from(0));
        let trees = timed(&mut times[1], || world.trees());
        timed(&mut times[2], || {
            world.insert(trees, merged);
            merged.tree().expect("room").header
        });
        timed(&mut times[3], || merged.restore().header);
    }
    let [rebuild, objects, merge, restore] = times.map(|times| median(&times));
    let percent = |time: f64| 100.0 * time / rebuild;
    println!(
        "  rebuilding {rebuild:.0} ms; of that: the objects' trees {:.1}%, merging {:.2}%, both {:.1}%; restoring {restore:.3} ms, \
         {:.4} of merging",
        percent(objects),
        percent(merge),
        percent(objects + merge),
        restore / merge
    );
}

fn measure_tracing(world: &World, merged: &KdTree) {
    let first = world.still.header.primitive_count;
    let (moving, whole) = (world.tree_from(first), world.tree_from(0));
    let sah = [merged, &whole, &world.still].map(|tree| quality::on_host(tree, 3.0, 2.0).sah);
    println!("  SAH: merged {:.1}, rebuilt {:.1}, static {:.1}", sah[0], sah[1], sah[2]);
    for kind in [RayKind::Primary, RayKind::Shadow, RayKind::Diffuse1, RayKind::Random] {
        let (rays, query) = (rays_of(&world.scene, kind, merged), kind.query());
        let one = |tree: &KdTree, ray: &Ray| {
            let (hit, work) = trace(tree, ray, query, Traversal::STACK);
            (hit, [u64::from(work.steps), u64::from(work.tests)])
        };
        let two = |ray: &Ray| trace_two([&world.still, &moving], first, ray, query);
        for ray in &rays {
            let (a, b) = (one(merged, ray).0, two(ray).0);
            assert!(if query == Query::ClosestHit { a == b } else { a.is_some() == b.is_some() }, "{ray:?}");
        }
        let mut times = [(); 3].map(|()| Vec::new());
        let mut works = [[0.0; 2]; 3];
        for which in (0..3).cycle().take(3 * TRACES) {
            let work = timed(&mut times[which], || {
                rays.iter().fold([0; 2], |sum, ray| {
                    let (hit, work) = if which == 0 { two(ray) } else { one([merged, &whole][which - 1], ray) };
                    black_box(hit);
                    [sum[0] + work[0], sum[1] + work[1]]
                })
            });
            works[which] = work.map(|work| work as f64 / rays.len() as f64);
        }
        let [two, one, new] = times.map(|times| median(&times));
        println!(
            "  {:8} two trees {:.1?}, merged {:.1?}, rebuilt {:.1?}; speed of merged over two {:.2}, over rebuilt {:.2}",
            kind.name(),
            works[0],
            works[1],
            works[2],
            two / one,
            new / one
        );
    }
}

#[test]
#[ignore = "prints what merging costs, in minutes, over scenes that are not in the repository"]
fn merging_beside_rebuilding() {
    let mut folders = own_folders();
    folders.extend(std::env::var_os("HEDGEROW_SCENES").map(Into::into));
    let options = LoadOptions { folders, progress: None };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let ball = "static sponza\nobject ball gen:icosphere:4\n at 0 move 0.23 1.5 0 scale 0.7\n at 1 move 1 1.5 0\n\
                frames 2\nseconds 1\ncamera\n at 0 eye -11 4 0.3 look 2 1.5 -0.3 fov 65\n";
    let path = folder.path().join("sponza_ball.dyn");
    std::fs::write(&path, ball).expect("a file in a temporary folder");
    let ball = path.display().to_string();
    let own = ["hall_ball", "atrium_run", "court_teapots", "city_giants", "hill_columns", "terrain_herd"];
    for spec in own.into_iter().chain([ball.as_str()]) {
        let scene = load_dynamic(spec, &options).expect(spec);
        let world = World::of(&scene, 0.23 * scene.seconds);
        let mut merged = Merged::new(world.still.clone(), Costs::DEFAULT);
        let still = world.still.header;
        println!("{}: {} static, {} triangles", scene.name, still.primitive_count, world.scene.mesh.triangles.len());
        measure_building(&world, &mut merged);
        world.insert(world.trees(), &mut merged);
        let tree = merged.tree().expect("room");
        tree.validate().expect("valid");
        let (of_objects, header) = (world.trees(), tree.header);
        let sum = |of: fn(&KdTree) -> u32| of_objects.iter().map(of).sum::<u32>();
        println!(
            "  nodes {} more ({} in the objects' trees), references {} more ({}); depth {}, status {}",
            header.node_count - still.node_count,
            sum(|tree| tree.header.node_count),
            header.reference_count - still.reference_count,
            sum(|tree| tree.header.reference_count),
            header.depth,
            header.status
        );
        measure_tracing(&world, tree);
    }
}
