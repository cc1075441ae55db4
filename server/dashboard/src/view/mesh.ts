// Surfaces and tetrahedra as the viewer has them, and how good their elements are.

export interface Mesh {
    positions: Float32Array; // #V by 3
    triangles: Uint32Array; // #T by 3; empty for particles
}

export interface TetMesh {
    positions: Float32Array; // #V by 3
    tets: Uint32Array; // #T by 4
}

type Point = [number, number, number];

function corner(positions: Float32Array, vertex: number): Point {
    return [positions[3 * vertex]!, positions[3 * vertex + 1]!, positions[3 * vertex + 2]!];
}

function distance(a: Point, b: Point): number {
    return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

/** 2 r_in / r_circ of each triangle: 1 regular, 0 degenerate. */
export function triangleQuality(mesh: Mesh): Float32Array {
    return perTriangle(mesh, (a, b, c) => {
        const s = (a + b + c) / 2;
        // r_in = area / s, r_circ = abc / (4 area)
        const squaredArea = Math.max(0, s * (s - a) * (s - b) * (s - c));
        return a * b * c > 0 ? (8 * squaredArea) / (s * a * b * c) : 0;
    });
}

/** Mean edge length of each triangle. */
export function triangleEdge(mesh: Mesh): Float32Array {
    return perTriangle(mesh, (a, b, c) => (a + b + c) / 3);
}

function perTriangle(mesh: Mesh, measure: (a: number, b: number, c: number) => number): Float32Array {
    const values = new Float32Array(mesh.triangles.length / 3);
    for (let t = 0; t < values.length; ++t) {
        const [i, j, k] = [0, 1, 2].map((n) => corner(mesh.positions, mesh.triangles[3 * t + n]!)) as [Point, Point, Point];
        values[t] = measure(distance(j, k), distance(k, i), distance(i, j));
    }
    return values;
}

const tetEdges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]] as const;

/** 3 r_in / r_circ of each tet: 1 regular, 0 flat. */
export function tetQuality(mesh: TetMesh): Float32Array {
    const values = new Float32Array(mesh.tets.length / 4);
    for (let t = 0; t < values.length; ++t) {
        const p = [0, 1, 2, 3].map((n) => corner(mesh.positions, mesh.tets[4 * t + n]!)) as [Point, Point, Point, Point];
        values[t] = radiusRatio(p);
    }
    return values;
}

/** Mean edge length of each tet. */
export function tetEdge(mesh: TetMesh): Float32Array {
    const values = new Float32Array(mesh.tets.length / 4);
    for (let t = 0; t < values.length; ++t) {
        let sum = 0;
        for (const [a, b] of tetEdges) {
            sum += distance(corner(mesh.positions, mesh.tets[4 * t + a]!), corner(mesh.positions, mesh.tets[4 * t + b]!));
        }
        values[t] = sum / 6;
    }
    return values;
}

const minus = (a: Point, b: Point): Point => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a: Point, b: Point): Point => [
    a[1] * b[2] - a[2] * b[1],
    a[2] * b[0] - a[0] * b[2],
    a[0] * b[1] - a[1] * b[0],
];
const dot = (a: Point, b: Point) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function radiusRatio(p: [Point, Point, Point, Point]): number {
    const u = minus(p[1], p[0]);
    const v = minus(p[2], p[0]);
    const w = minus(p[3], p[0]);
    const [vw, wu, uv] = [cross(v, w), cross(w, u), cross(u, v)];
    const sixVolumes = dot(u, vw);
    const opposite = cross(minus(p[2], p[1]), minus(p[3], p[1]));
    const twoAreas = [vw, wu, uv, opposite].reduce((sum, n) => sum + Math.sqrt(dot(n, n)), 0);
    const [uu, vv, ww] = [dot(u, u), dot(v, v), dot(w, w)];
    const centre = [0, 1, 2].map((i) => uu * vw[i]! + vv * wu[i]! + ww * uv[i]!) as Point;
    // r_in = |6V| / sum(2A), r_circ = |centre| / |12V|
    const denominator = twoAreas * Math.sqrt(dot(centre, centre));
    return denominator > 0 ? (6 * sixVolumes * Math.abs(sixVolumes)) / denominator : 0;
}

/** Faces seen once a tet is hidden: those that belong to exactly one shown tet. */
export interface Clip {
    axis: 0 | 1 | 2;
    /** Share of the box that is cut away, in [0, 1]; 0 cuts nothing. */
    share: number;
}

/** The end of each axis that is nearer to the eye at first: from there it's cut away. */
export const cutFrom = [1, -1, 1] as const;

/** The corners of the box around what is finite. */
export function boxOf(positions: Float32Array): { low: Point; high: Point } {
    const low: Point = [Infinity, Infinity, Infinity];
    const high: Point = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < positions.length; i += 3) {
        if (Number.isFinite(positions[i]! + positions[i + 1]! + positions[i + 2]!)) {
            for (let n = 0; n < 3; ++n) {
                low[n] = Math.min(low[n]!, positions[i + n]!);
                high[n] = Math.max(high[n]!, positions[i + n]!);
            }
        }
    }
    return { low, high };
}

/** Where the axis is cut, model units. */
export function cutOf(positions: Float32Array, clip: Clip): number {
    const { low, high } = boxOf(positions);
    const depth = clip.share * (high[clip.axis] - low[clip.axis]);
    return cutFrom[clip.axis] > 0 ? high[clip.axis] - depth : low[clip.axis] + depth;
}

export class TetFaces {
    private readonly neighbours: Int32Array; // #T by 4, across the face opposite of the corner; -1 outside

    constructor(readonly mesh: TetMesh) {
        this.neighbours = neighboursOf(mesh.tets);
    }

    /** \return three vertices and the tet of each face that bounds what `isShown` keeps */
    boundary(isShown: (tet: number) => boolean): { triangles: Uint32Array; owner: Uint32Array } {
        const { tets } = this.mesh;
        const count = tets.length / 4;
        const shown = new Uint8Array(count);
        for (let t = 0; t < count; ++t) {
            shown[t] = isShown(t) ? 1 : 0;
        }
        const triangles: number[] = [];
        const owner: number[] = [];
        for (let t = 0; t < count; ++t) {
            if (shown[t]) {
                for (let f = 0; f < 4; ++f) {
                    const across = this.neighbours[4 * t + f]!;
                    if (across < 0 || !shown[across]) {
                        const [a, b, c] = faces[f]!;
                        triangles.push(tets[4 * t + a]!, tets[4 * t + b]!, tets[4 * t + c]!);
                        owner.push(t);
                    }
                }
            }
        }
        return { triangles: new Uint32Array(triangles), owner: new Uint32Array(owner) };
    }
}

/** Corners of the face opposite of each corner, seen from outside. */
const faces = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]] as const;

function neighboursOf(tets: Uint32Array): Int32Array {
    const count = tets.length;
    const neighbours = new Int32Array(count).fill(-1);
    // An open hash table of faces by their sorted corners, in flat arrays: maps are ten times slower.
    let size = 1;
    while (size < 2 * count) {
        size *= 2;
    }
    const slots = new Int32Array(size).fill(-1);
    const key = new Uint32Array(3 * count);
    for (let i = 0; i < count; ++i) {
        const t = i >> 2;
        const face = faces[i & 3]!;
        const ids = [tets[4 * t + face[0]]!, tets[4 * t + face[1]]!, tets[4 * t + face[2]]!].sort((a, b) => a - b);
        key.set(ids, 3 * i);
        let slot = (Math.imul(ids[0]!, 73_856_093) ^ Math.imul(ids[1]!, 19_349_663) ^ Math.imul(ids[2]!, 83_492_791)) & (size - 1);
        for (;;) {
            const other = slots[slot]!;
            if (other < 0) {
                slots[slot] = i;
                break;
            }
            if (key[3 * other] === ids[0] && key[3 * other + 1] === ids[1] && key[3 * other + 2] === ids[2]) {
                neighbours[i] = other >> 2;
                neighbours[other] = t;
                break;
            }
            slot = (slot + 1) & (size - 1);
        }
    }
    return neighbours;
}
