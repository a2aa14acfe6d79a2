//! The lines of a `.dyn` file, each understood by itself and checked, before any scene is loaded.

use crate::Result;
use crate::scene::DynamicScene;
use crate::scene::check::malformed;
use std::path::Path;

/// The vertical field of view of a camera that does not say it, in degrees.
pub(super) const FOV: f32 = 60.0;

/// What a file says.
#[derive(Debug)]
pub(super) struct Lines {
    pub frames: u32,
    pub seconds: f32,
    pub static_scene: Option<OfLine<String>>,
    pub objects: Vec<Object>,
    pub camera: Option<CameraKeys>,
}

/// The keys of a camera.
#[derive(Debug)]
pub(super) struct CameraKeys {
    /// How it goes from key to key.
    pub way: Way,
    /// One or more.
    pub keys: Vec<Key>,
}

/// How a camera goes from key to key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// Straight, with a corner at each key.
    Straight,
    /// Along a curve.
    Smooth,
}

/// The line that says something, and what it says.
pub(super) type OfLine<T> = (usize, T);

#[derive(Debug)]
pub(super) struct Object {
    pub name: String,
    pub scene: OfLine<String>,
    /// In seconds.
    pub cycle: Option<OfLine<f32>>,
    pub keys: Vec<Key>,
}

/// A line that says where something is at a time: parts, each a word and its numbers.
#[derive(Debug)]
pub(super) struct Key {
    pub line: usize,
    pub time: f32,
    parts: Vec<(&'static str, Vec<f32>)>,
}

impl Key {
    /// The numbers of a part, if the key names it.
    pub fn part(&self, name: &str) -> Option<&[f32]> {
        self.parts.iter().find(|(part, _)| *part == name).map(|(_, numbers)| numbers.as_slice())
    }
}

/// A part of a key: its word, how many numbers follow, and how it is written.
type Part = (&'static str, &'static [usize], &'static str);

const OF_OBJECTS: [Part; 4] = [
    ("move", &[3], "move X Y Z"),
    ("turn", &[4], "turn X Y Z DEGREES (about an axis)"),
    ("quaternion", &[4], "quaternion X Y Z W"),
    ("scale", &[1, 3], "scale S or scale X Y Z"),
];
const OF_CAMERAS: [Part; 4] =
    [("eye", &[3], "eye X Y Z"), ("look", &[3], "look X Y Z"), ("up", &[3], "up X Y Z"), ("fov", &[1], "fov DEGREES")];

/// A turn goes through all its degrees, 60 at a time.
const MOST_DEGREES: f32 = 36_000.0;

/// What the keys below belong to.
#[derive(Clone, Copy, Default)]
enum Above {
    #[default]
    Nothing,
    Object,
    Camera,
}

/// A file while its lines are read.
#[derive(Default)]
struct Reading {
    frames: Option<OfLine<u32>>,
    seconds: Option<OfLine<f32>>,
    static_scene: Option<OfLine<String>>,
    objects: Vec<Object>,
    camera: Option<OfLine<CameraKeys>>,
    above: Above,
}

impl Lines {
    /// Reads the text of the file at `path`.
    pub fn read(path: &Path, text: &str) -> Result<Lines> {
        let mut reading = Reading::default();
        for (line, text) in (1..).zip(text.lines()) {
            let text = text.split_once('#').map_or(text, |(before, _)| before).trim();
            if !text.is_empty() {
                let fault = reading.line(line, text);
                fault.map_err(|what| malformed(format_args!("{}:{line}", path.display()), what))?;
            }
        }
        reading.whole().map_err(|(line, what)| {
            let line = line.map_or(String::new(), |line| format!(":{line}"));
            malformed(format_args!("{}{line}", path.display()), what)
        })
    }
}

/// What is wrong, without the place.
type Fault = String;

impl Reading {
    fn line(&mut self, line: usize, text: &str) -> Result<(), Fault> {
        let (word, rest) = split(text);
        match word {
            "frames" => {
                let most = DynamicScene::MOST_FRAMES;
                let wrong = || format!("{rest:?} is not a number of frames; write one from 1 to {most}");
                let frames = rest.parse().ok().filter(|n| (1..=most).contains(n)).ok_or_else(wrong)?;
                once(&mut self.frames, line, frames, "frames")
            }
            "seconds" => once(&mut self.seconds, line, duration(rest)?, "seconds"),
            "static" if rest.is_empty() => Err("static names no scene; write one behind it, as in static hall".into()),
            "static" => {
                self.above = Above::Nothing;
                once(&mut self.static_scene, line, rest.into(), "static")
            }
            "object" => {
                let (name, spec) = split(rest);
                if spec.is_empty() {
                    return Err("an object is a name and a scene; write it as in object ball gen:icosphere:3".into());
                }
                if let Some(Object { scene: (before, _), .. }) = self.objects.iter().find(|o| o.name == name) {
                    return Err(format!("the object of line {before} is called {name:?}, too; rename one"));
                }
                self.above = Above::Object;
                let scene = (line, spec.into());
                self.objects.push(Object { name: name.into(), scene, cycle: None, keys: Vec::new() });
                Ok(())
            }
            "camera" => {
                let way = match rest {
                    "" => Way::Straight,
                    "smooth" => Way::Smooth,
                    _ => {
                        let what = "its keys are lines of their own; smooth alone may stand there";
                        return Err(format!("{rest:?} behind camera; {what}"));
                    }
                };
                self.above = Above::Camera;
                once(&mut self.camera, line, CameraKeys { way, keys: Vec::new() }, "camera")
            }
            "cycle" => match (self.above, self.objects.last_mut()) {
                (Above::Object, Some(object)) => once(&mut object.cycle, line, duration(rest)?, "cycle"),
                _ => Err("a cycle without an object; write it below the one that it is of".into()),
            },
            "at" => {
                let (parts, keys) = match (self.above, self.objects.last_mut(), &mut self.camera) {
                    (Above::Object, Some(object), _) => (&OF_OBJECTS, &mut object.keys),
                    (Above::Camera, _, Some((_, camera))) => (&OF_CAMERAS, &mut camera.keys),
                    _ => return Err("a key of nothing; write it below the object or camera that it is of".into()),
                };
                let key = key(line, rest, parts)?;
                if let Some(Key { line, time, .. }) = keys.last().filter(|before| before.time >= key.time) {
                    let here = key.time;
                    return Err(format!("{here} s is not behind the {time} s of line {line}; sort the keys by time"));
                }
                keys.push(key);
                Ok(())
            }
            _ => Err(format!(
                "{word:?} begins no line of a dynamic scene; those are frames, seconds, static, object, cycle, camera and at"
            )),
        }
    }

    /// Everything is there and fits together; else the line and what is wrong.
    fn whole(self) -> Result<Lines, (Option<usize>, Fault)> {
        let missing = |what: &str| (None, format!("does not say its {what}; write a line as in {what} 24"));
        let (_, frames) = self.frames.ok_or_else(|| missing("frames"))?;
        let (_, seconds) = self.seconds.ok_or_else(|| missing("seconds"))?;
        if let Some((line, _)) = self.camera.as_ref().filter(|(_, camera)| camera.keys.is_empty()) {
            return Err((Some(*line), "a camera without keys; write them as in at 0 eye 0 1 5 look 0 0 0".into()));
        }
        let camera = self.camera.map(|(_, camera)| camera);
        let of_camera = camera.iter().flat_map(|camera| &camera.keys);
        let keys = self.objects.iter().flat_map(|object| &object.keys).chain(of_camera);
        if let Some(key) = keys.into_iter().find(|key| key.time > seconds) {
            let what = format!("a key at {} s, the scene begins again after {seconds}; take an earlier time", key.time);
            return Err((Some(key.line), what));
        }
        Ok(Lines { frames, seconds, static_scene: self.static_scene, objects: self.objects, camera })
    }
}

/// The first word, and what is behind it.
fn split(text: &str) -> (&str, &str) {
    text.split_once(char::is_whitespace).map_or((text, ""), |(word, rest)| (word, rest.trim_start()))
}

fn number(word: &str) -> Option<f32> {
    word.parse().ok().filter(|n: &f32| n.is_finite())
}

fn duration(text: &str) -> Result<f32, Fault> {
    let seconds = number(text).filter(|s| *s > 0.0);
    seconds.ok_or_else(|| format!("{text:?} is not a time to last; write seconds above 0, as in 2.5"))
}

fn once<T>(place: &mut Option<OfLine<T>>, line: usize, value: T, what: &str) -> Result<(), Fault> {
    if let Some((before, _)) = place {
        return Err(format!("{what} stands in line {before} already; remove one"));
    }
    *place = Some((line, value));
    Ok(())
}

/// A time, and parts of which each stands once.
fn key(line: usize, text: &str, known: &[Part]) -> Result<Key, Fault> {
    let written = || known.iter().map(|(_, _, usage)| *usage).collect::<Vec<_>>().join(", ");
    let (time, mut rest) = split(text);
    let time = number(time).filter(|t| *t >= 0.0);
    let time = time.ok_or("a key begins with its time in seconds, from 0 on; write it as in at 1.5 …".to_owned())?;
    let mut parts: Vec<(&'static str, Vec<f32>)> = Vec::new();
    while !rest.is_empty() {
        let (word, behind) = split(rest);
        let Some(&(name, counts, usage)) = known.iter().find(|(name, ..)| *name == word) else {
            return Err(format!("{word:?} is not part of this key; use {}", written()));
        };
        if parts.iter().any(|(part, _)| *part == name) {
            return Err(format!("{name} stands twice in one key; remove one"));
        }
        rest = behind;
        let mut numbers = Vec::new();
        while let Some(number) = number(split(rest).0) {
            numbers.push(number);
            rest = split(rest).1;
        }
        if !counts.contains(&numbers.len()) {
            let found = split(rest).0;
            let found = if found.is_empty() { String::new() } else { format!(" before {found:?}") };
            return Err(format!("{name} has {} finite numbers{found}; write {usage}", numbers.len()));
        }
        meaningful(name, &numbers)?;
        parts.push((name, numbers));
    }
    let has = |name: &str| parts.iter().any(|(part, _)| *part == name);
    if has("turn") && has("quaternion") {
        return Err("turn and quaternion are both the rotation; remove one".into());
    }
    if parts.is_empty() {
        return Err(format!("a key that says nothing; write what is so then: {}", written()));
    }
    Ok(Key { line, time, parts })
}

/// The numbers of a part are such as it can have.
fn meaningful(part: &str, numbers: &[f32]) -> Result<(), Fault> {
    Err(match (part, numbers) {
        ("scale", numbers) if numbers.contains(&0.0) => {
            "a scale of 0 leaves nothing of the object; take a small one".into()
        }
        ("turn", [0.0, 0.0, 0.0, _]) => {
            "a turn about (0, 0, 0), an axis needs a length; write it as in turn 0 1 0 90".into()
        }
        ("quaternion", [0.0, 0.0, 0.0, 0.0]) => {
            "the quaternion (0, 0, 0, 0) is not a rotation; write quaternion 0 0 0 1 for no rotation".into()
        }
        ("turn", [.., degrees]) if degrees.abs() > MOST_DEGREES => {
            format!("a turn of {degrees} degrees, there may be {MOST_DEGREES}; take fewer")
        }
        ("fov", [degrees]) if !(*degrees > 0.0 && *degrees < 180.0) => {
            format!("a field of view of {degrees} degrees; it lies between 0 and 180")
        }
        _ => return Ok(()),
    })
}
