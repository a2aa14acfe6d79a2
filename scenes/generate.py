#!/usr/bin/env python3
"""Writes the scenes of this folder that are our own: hall.glb, knot.ply, grass.tri, pine_hill.inst and its hill.

    scenes/generate.py OUT [PINE.obj]

Needs nothing but Python. `grass.tri` and `pine_hill_parts.obj` lie here packed (`zstd -19 --rm`). The pine is not ours, see
README.md: its OBJ file, one unit high, is named on the command line and goes into pine_hill_parts.obj behind the hill.
The same numbers come out every time: random ones are seeded, and coordinates are rounded.
"""

import json
import math
import random
import struct
import sys
from pathlib import Path

TAU = 2 * math.pi


class Mesh:
    """Vertices and triangles; quads are cut along the diagonal from their first corner."""

    def __init__(self):
        self.vertices, self.triangles = [], []

    def vertex(self, x, y, z):
        self.vertices.append((x, y, z))
        return len(self.vertices) - 1

    def quad(self, a, b, c, d):
        self.triangles += [(a, b, c), (a, c, d)]

    def corners(self, *points):
        """A quad of its own four points."""
        self.quad(*(self.vertex(*p) for p in points))

    def grid(self, rows, columns, point, wrap_rows=False, wrap_columns=False):
        """rows × columns quads between the points point(row, column)."""
        height, width = rows + (not wrap_rows), columns + (not wrap_columns)
        first = len(self.vertices)
        for row in range(height):
            for column in range(width):
                self.vertex(*point(row, column))
        at = lambda row, column: first + row % height * width + column % width
        for row in range(rows):
            for column in range(columns):
                self.quad(at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column))

    def box(self, low, high):
        (x, y, z), (X, Y, Z) = low, high
        p = [(a, b, c) for a in (x, X) for b in (y, Y) for c in (z, Z)]
        for a, b, c, d in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)):
            self.corners(p[a], p[b], p[c], p[d])

    def add(self, other, place=lambda p: p):
        first = len(self.vertices)
        self.vertices += [place(p) for p in other.vertices]
        self.triangles += [tuple(first + v for v in t) for t in other.triangles]


def moved(x, y, z):
    return lambda p: (p[0] + x, p[1] + y, p[2] + z)


def lathe(profile, segments, flutes=0.0):
    """Turns a profile of (radius, height) about y; flutes cut that share of the radius out of every second segment."""
    mesh = Mesh()

    def point(row, column):
        radius, height = profile[row]
        radius *= 1 - flutes * (column % 2)
        return radius * math.cos(TAU * column / segments), height, radius * math.sin(TAU * column / segments)

    mesh.grid(len(profile) - 1, segments, point, wrap_columns=True)
    return mesh


def tube(curve, around, radius):
    """A closed tube about the points of a closed curve."""
    mesh, count = Mesh(), len(curve)
    frames = []
    for i, p in enumerate(curve):
        ahead, behind = curve[(i + 1) % count], curve[i - 1]
        along = unit([a - b for a, b in zip(ahead, behind)])
        aside = unit(cross(along, [b + a - 2 * c for a, b, c in zip(ahead, behind, p)]))
        frames.append((aside, cross(along, aside)))

    def point(row, column):
        angle = TAU * column / around
        aside, other = frames[row]
        return tuple(
            c + radius * (math.cos(angle) * a + math.sin(angle) * o) for c, a, o in zip(curve[row], aside, other)
        )

    mesh.grid(count, around, point, wrap_rows=True, wrap_columns=True)
    return mesh


def unit(v):
    length = math.sqrt(sum(c * c for c in v)) or 1
    return [c / length for c in v]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def knot_curve(count, p=2, q=3, large=2.0, small=0.8):
    """A torus knot that winds p times about the axis and q times about the ring."""
    points = []
    for i in range(count):
        t = TAU * i / count
        ring = large + small * math.cos(q * t)
        points.append((ring * math.cos(p * t), small * math.sin(q * t), ring * math.sin(p * t)))
    return points


def circle(radius, count):
    return [(radius * math.cos(TAU * i / count), 0, radius * math.sin(TAU * i / count)) for i in range(count)]


def sphere(radius, rows, columns):
    profile = [(radius * math.sin(math.pi * i / rows), -radius * math.cos(math.pi * i / rows)) for i in range(rows + 1)]
    return lathe(profile, columns)


def panel(width, height, half, sill, spring, thickness, segments=24):
    """A wall in the plane of x and y with an opening under a round arch, `2·half` wide, from sill to spring and the arc."""
    mesh = Mesh()
    arc = [(half * math.cos(math.pi * i / segments), spring + half * math.sin(math.pi * i / segments)) for i in range(segments + 1)]
    for z in (-thickness / 2, thickness / 2):
        for (x0, y0), (x1, y1) in zip(arc, arc[1:]):
            mesh.corners((x0, y0, z), (x0, height, z), (x1, height, z), (x1, y1, z))
        for side in (-1, 1):
            mesh.corners((side * half, 0, z), (side * width / 2, 0, z), (side * width / 2, height, z), (side * half, height, z))
        if sill > 0:
            mesh.corners((-half, 0, z), (half, 0, z), (half, sill, z), (-half, sill, z))
    inner = [(half, sill)] + arc + [(-half, sill)]
    for (x0, y0), (x1, y1) in zip(inner, inner[1:] + inner[:1]):
        mesh.corners((x0, y0, -thickness / 2), (x1, y1, -thickness / 2), (x1, y1, thickness / 2), (x0, y0, thickness / 2))
    return mesh


def column():
    profile = [(0.62, 0), (0.62, 0.25), (0.55, 0.25)]
    profile += [(0.50 + 0.07 * math.sin(math.pi * i / 6), 0.25 + 0.2 * i / 6) for i in range(7)]
    base = lathe(profile, 40)
    shaft = lathe([(0.44 - 0.06 * i / 8 + 0.02 * math.sin(math.pi * i / 8), 0.45 + 4.75 * i / 8) for i in range(9)], 40, flutes=0.09)
    capital = lathe([(0.38 + 0.24 * (i / 8) ** 2, 5.2 + 0.6 * i / 8) for i in range(9)], 40)
    base.add(shaft)
    base.add(capital)
    base.box((-0.66, 5.8, -0.66), (0.66, 6.0, 0.66))
    return base


def chandelier():
    mesh = Mesh()
    mesh.add(tube(circle(1.1, 64), 10, 0.04))
    mesh.add(tube(circle(0.7, 48), 10, 0.03), moved(0, 0.35, 0))
    candle = lathe([(0.0, 0), (0.09, 0), (0.05, 0.05), (0.035, 0.06), (0.035, 0.3), (0.0, 0.3)], 12)
    flame = sphere(0.05, 8, 12)
    for radius, height, count in ((1.1, 0.04, 16), (0.7, 0.39, 10)):
        for i in range(count):
            x, z = radius * math.cos(TAU * i / count), radius * math.sin(TAU * i / count)
            mesh.add(candle, moved(x, height, z))
            mesh.add(flame, moved(x, height + 0.37, z))
    link = tube([(0.06 * math.cos(t), 0.11 * math.sin(t), 0) for t in (TAU * i / 16 for i in range(16))], 6, 0.012)
    for i in range(14):
        turned = (lambda p: (p[2], p[1], p[0])) if i % 2 else (lambda p: p)
        mesh.add(link, lambda p, turned=turned, i=i: moved(0, 0.5 + 0.18 * i, 0)(turned(p)))
    return mesh


def coffer(size):
    """A square of the ceiling, looking down, cut in by three steps."""
    mesh = Mesh()
    outer, height = size / 2, 0.0
    ring = lambda half, y: [(-half, y, -half), (half, y, -half), (half, y, half), (-half, y, half)]
    for step in range(3):
        inner = outer - size * 0.08
        a, b = ring(outer, height), ring(inner, height)
        c = ring(inner, height + 0.15)
        for i in range(4):
            j = (i + 1) % 4
            mesh.corners(a[i], a[j], b[j], b[i])
            mesh.corners(b[i], b[j], c[j], c[i])
        outer, height = inner, height + 0.15
    mesh.corners(*ring(outer, height))
    return mesh


def bench():
    mesh = Mesh()
    mesh.box((-1.4, 0.42, -0.2), (1.4, 0.48, 0.2))
    mesh.box((-1.4, 0.48, 0.16), (1.4, 1.0, 0.2))
    for x in (-1.3, 0, 1.3):
        mesh.box((x - 0.05, 0, -0.18), (x + 0.05, 0.42, 0.18))
    for x in (-1.4, 1.34):
        mesh.box((x, 0.48, -0.2), (x + 0.06, 0.75, 0.16))
    return mesh


class Hall:
    """A pillared hall, 40 m long: what repeats is stored once and placed by nodes."""

    BAYS = [4.0 * i for i in range(-4, 5)]

    def __init__(self):
        self.meshes, self.nodes = [], []
        self.place(self.shell())
        col, arch, window = column(), panel(4, 6, 1.45, 0, 0, 0.8), panel(4, 8, 0.9, 2.2, 5, 0.6)
        at = [(x, 0, z) for z in (-5, 5) for x in [b - 2 for b in self.BAYS] + [18]]
        self.place(col, at)
        self.place(arch, [(x, 6, z) for z in (-5, 5) for x in self.BAYS])
        self.place(window, [(x, 0, z) for z in (-8.3, 8.3) for x in self.BAYS])
        self.place(coffer(2.0), [(-17 + 2 * i, 12, -4 + 2 * j) for i in range(18) for j in range(5)])
        self.place(bench(), [(-6.0 + 1.5 * i, 0, z) for i in range(10) for z in (-2.2, 2.2)], turned=True)
        self.place(chandelier(), [(x, 8.8, 0) for x in (-12, -4, 4, 12)])
        self.place(tube(knot_curve(220, large=0.7, small=0.3), 16, 0.13), [(15.5, 2.75, 0)], standing=True)

    def shell(self):
        mesh = Mesh()
        mesh.grid(40, 18, lambda row, column: (-20 + row, 0, -9 + column))
        for z in (-8.6, 8.6):
            side = 1 if z > 0 else -1
            mesh.corners((-20, 8, z), (20, 8, z), (20, 8, side * 4.6), (-20, 8, side * 4.6))
            for x in (-19, 19):
                mesh.corners((x - 1, 0, z - side * 0.3), (x + 1, 0, z - side * 0.3), (x + 1, 8, z - side * 0.3), (x - 1, 8, z - side * 0.3))
                mesh.corners((x - 1, 6, side * 5), (x + 1, 6, side * 5), (x + 1, 12, side * 5), (x - 1, 12, side * 5))
        for x in (-20, 20):
            mesh.corners((x, 0, -9), (x, 0, 9), (x, 13, 9), (x, 13, -9))
            low, high = sorted((x, math.copysign(18, x)))
            mesh.corners((low, 12, -5), (high, 12, -5), (high, 12, 5), (low, 12, 5))
        for i in range(6):
            mesh.box((12.5 + 0.3 * i, 0.15 * i, -3.5 + 0.1 * i), (18.5, 0.15 * (i + 1), 3.5 - 0.1 * i))
        mesh.add(lathe([(0.0, 1.9), (0.55, 1.9), (0.5, 1.8), (0.4, 1.7), (0.4, 1.2), (0.5, 1.05), (0.6, 0.9)], 32), moved(15.5, 0, 0))
        return mesh

    def place(self, mesh, at=((0, 0, 0),), turned=False, standing=False):
        self.meshes.append(mesh)
        half = math.sqrt(0.5)
        for position in at:
            node = {"mesh": len(self.meshes) - 1, "translation": list(position)}
            if turned:
                node["rotation"] = [0, half, 0, half]
            if standing:
                node["rotation"] = [0, 0, half, half]
            self.nodes.append(node)

    def glb(self):
        binary, views, accessors, meshes = bytearray(), [], [], []
        for mesh in self.meshes:
            data = [struct.pack("<3f", *(round(c, 4) for c in p)) for p in mesh.vertices]
            short = len(mesh.vertices) < 65536
            packed = [b"".join(data), b"".join(struct.pack("<3H" if short else "<3I", *t) for t in mesh.triangles)]
            for part in packed:
                views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(part)})
                binary += part + bytes(-len(part) % 4)
            xyz = list(zip(*[struct.unpack("<3f", d) for d in data]))
            accessors.append({
                "bufferView": len(views) - 2, "componentType": 5126, "count": len(mesh.vertices), "type": "VEC3",
                "min": [min(c) for c in xyz], "max": [max(c) for c in xyz],
            })
            accessors.append({
                "bufferView": len(views) - 1, "componentType": 5123 if short else 5125, "count": 3 * len(mesh.triangles),
                "type": "SCALAR",
            })
            meshes.append({"primitives": [{"attributes": {"POSITION": len(accessors) - 2}, "indices": len(accessors) - 1}]})
        lamps = [{"translation": [x, 8.6, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}} for x in (-12, -4, 4, 12)]
        eye, look = (-18.5, 2.1, 2.6), (8, 4.6, -1.2)
        back = unit([a - b for a, b in zip(eye, look)])
        right = unit(cross([0, 1, 0], back))
        up = cross(back, right)
        nodes = self.nodes + lamps + [{"camera": 0, "matrix": [*right, 0, *up, 0, *back, 0, *eye, 1]}]
        document = {
            "asset": {"version": "2.0", "generator": "hedgerow scenes/generate.py", "copyright": "hedgerow, MIT OR Apache-2.0"},
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 800}]}},
            "buffers": [{"byteLength": len(binary)}], "bufferViews": views, "accessors": accessors, "meshes": meshes,
            "cameras": [{"type": "perspective", "perspective": {"yfov": 1.05, "znear": 0.1}}],
            "nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}], "scene": 0,
        }
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + bytes(binary)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def ply(mesh):
    head = (
        "ply\nformat binary_little_endian 1.0\ncomment hedgerow scenes/generate.py, MIT OR Apache-2.0\n"
        f"element vertex {len(mesh.vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(mesh.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return head.encode() + b"".join(struct.pack("<3f", *(round(c, 4) for c in p)) for p in mesh.vertices) + b"".join(
        struct.pack("<B3i", 3, *t) for t in mesh.triangles
    )


def tri(mesh):
    """Coordinates are rounded to 1/4096, so that they pack."""
    data = struct.pack("<2I", len(mesh.vertices), len(mesh.triangles))
    data += b"".join(struct.pack("<3f", *(round(c * 4096) / 4096 for c in p)) for p in mesh.vertices)
    return data + b"".join(struct.pack("<3I", *t) for t in mesh.triangles)


def obj(name, mesh):
    """The vertices and the faces of an object, apart: all vertices of a file come first."""
    faces = "".join("f " + " ".join(str(v + 1) for v in t) + "\n" for t in mesh.triangles)
    return "".join("v " + " ".join(f"{c:.3f}" for c in p) + "\n" for p in mesh.vertices), f"o {name}\n{faces}"


def grass(blades=4000):
    """Curved blades of grass on a disc of 2 m: long thin triangles, many boxes over each other."""
    rng, mesh = random.Random(4), Mesh()
    for _ in range(blades):
        radius, where = 2 * math.sqrt(rng.random()), TAU * rng.random()
        x, z = radius * math.cos(where), radius * math.sin(where)
        height, lean, heading = 0.25 + 0.45 * rng.random(), 0.1 + 0.5 * rng.random(), TAU * rng.random()
        c, s = math.cos(heading), math.sin(heading)
        sides = []
        for i in range(5):
            t = i / 4
            out, up, half = lean * height * t * t, height * t * (1 - 0.25 * lean * t), 0.006 * (1 - t)
            middle = (x + c * out, up, z + s * out)
            ends = ((-s * half, c * half), (s * half, -c * half)) if i < 4 else ((0, 0),)
            sides.append([mesh.vertex(middle[0] + a, middle[1], middle[2] + b) for a, b in ends])
        for low, high in zip(sides, sides[1:]):
            if len(high) == 2:
                mesh.quad(low[0], low[1], high[1], high[0])
            else:
                mesh.triangles.append((low[0], low[1], high[0]))
    return mesh


class Hill:
    """A hill of 120 m on which pines stand."""

    CELLS, EDGE = 128, 120.0

    def __init__(self):
        rng = random.Random(7)
        self.waves = []
        for octave in range(6):
            for _ in range(3):
                angle, phase = TAU * rng.random(), TAU * rng.random()
                frequency = 0.045 * 1.9**octave
                self.waves.append((frequency * math.cos(angle), frequency * math.sin(angle), phase, 2.6 * 0.5**octave))

    def height(self, x, z):
        centre = math.exp(-((x - 8) ** 2 + (z + 5) ** 2) / 1500)
        return 16 * centre + sum(a * math.sin(fx * x + fz * z + phase) for fx, fz, phase, a in self.waves)

    def mesh(self):
        mesh, step = Mesh(), self.EDGE / self.CELLS
        at = lambda i: i * step - self.EDGE / 2
        mesh.grid(self.CELLS, self.CELLS, lambda row, column: (at(column), self.height(at(column), at(row)), at(row)))
        return mesh

    def instances(self, count=64):
        rng, trees = random.Random(11), []
        while len(trees) < count:
            x, z = (rng.uniform(-0.47, 0.47) * self.EDGE for _ in range(2))
            if all((x - a) ** 2 + (z - b) ** 2 > 25 for a, b, _ in trees):
                trees.append((x, z, rng.uniform(7, 13)))
        lines = ["# The hill and the pines on it: an object of pine_hill_parts.obj and a row-major 3x4 matrix."]
        lines.append("hill 1 0 0 0 0 1 0 0 0 0 1 0")
        for x, z, size in trees:
            turn = TAU * rng.random()
            c, s = size * math.cos(turn), size * math.sin(turn)
            y = self.height(x, z) - 0.03 * size
            lines.append(f"pine {c:.4f} 0 {s:.4f} {x:.4f} 0 {size:.4f} 0 {y:.4f} {-s:.4f} 0 {c:.4f} {z:.4f}")
        return "\n".join(lines) + "\n"


def pine_of(path):
    mesh = Mesh()
    for line in Path(path).read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            mesh.vertex(*map(float, words[1:4]))
        elif words[:1] == ["f"]:
            mesh.triangles.append(tuple(int(w.split("/")[0]) - 1 for w in words[1:]))
    return mesh


def main():
    out = Path(sys.argv[1])
    (out / "hall.glb").write_bytes(Hall().glb())
    (out / "knot.ply").write_bytes(ply(tube(knot_curve(640), 24, 0.35)))
    (out / "grass.tri").write_bytes(tri(grass()))
    hill = Hill()
    (out / "pine_hill.inst").write_text(hill.instances())
    if len(sys.argv) > 2:
        ground, pine = hill.mesh(), pine_of(sys.argv[2])
        first = len(ground.vertices)
        pine.triangles = [tuple(v + first for v in t) for t in pine.triangles]
        (hill_vertices, hill_faces), (pine_vertices, pine_faces) = obj("hill", ground), obj("pine", pine)
        (out / "pine_hill_parts.obj").write_text(hill_vertices + pine_vertices + hill_faces + pine_faces)


if __name__ == "__main__":
    main()
