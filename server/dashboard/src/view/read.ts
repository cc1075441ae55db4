// Readers for what the server writes (binary PLY, compressed VTU) and for inputs that are simple
// enough: STL. Anything else is told to be unreadable, never guessed.

import type { Mesh, TetMesh } from './mesh';

export class Unreadable extends Error {}

const sizes: Record<string, number> = {
    char: 1, int8: 1, uchar: 1, uint8: 1, short: 2, int16: 2, ushort: 2, uint16: 2,
    int: 4, int32: 4, uint: 4, uint32: 4, float: 4, float32: 4, double: 8, float64: 8,
};

function scalar(view: DataView, type: string, at: number): number {
    switch (type) {
        case 'double': case 'float64': return view.getFloat64(at, true);
        case 'float': case 'float32': return view.getFloat32(at, true);
        case 'int': case 'int32': return view.getInt32(at, true);
        case 'uint': case 'uint32': return view.getUint32(at, true);
        case 'short': case 'int16': return view.getInt16(at, true);
        case 'ushort': case 'uint16': return view.getUint16(at, true);
        case 'char': case 'int8': return view.getInt8(at);
        default: return view.getUint8(at);
    }
}

interface Property {
    name: string;
    type: string;
    countType?: string;
}

/** Binary little-endian PLY of vertices and, possibly no, triangles. */
export function readPly(bytes: ArrayBuffer): Mesh {
    const head = new TextDecoder('latin1').decode(bytes.slice(0, 65_536));
    const end = head.indexOf('end_header\n');
    if (!head.startsWith('ply') || end < 0 || !head.includes('format binary_little_endian')) {
        throw new Unreadable('Only binary little-endian PLY is shown.');
    }
    const elements: { name: string; count: number; properties: Property[] }[] = [];
    for (const line of head.slice(0, end).split('\n')) {
        const words = line.trim().split(/\s+/);
        if (words[0] === 'element') {
            elements.push({ name: words[1]!, count: Number(words[2]), properties: [] });
        } else if (words[0] === 'property') {
            elements.at(-1)?.properties.push(
                words[1] === 'list'
                    ? { name: words[4]!, type: words[3]!, countType: words[2] }
                    : { name: words[2]!, type: words[1]! },
            );
        }
    }
    const view = new DataView(bytes);
    let at = end + 'end_header\n'.length;
    let positions = new Float32Array(0);
    const triangles: number[] = [];
    for (const element of elements) {
        if (element.name === 'vertex') {
            positions = new Float32Array(3 * element.count);
        }
        for (let i = 0; i < element.count; ++i) {
            for (const property of element.properties) {
                if (property.countType) {
                    const length = scalar(view, property.countType, at);
                    at += sizes[property.countType]!;
                    const step = sizes[property.type]!;
                    if (element.name === 'face' && property.name.startsWith('vertex_ind')) {
                        for (let k = 2; k < length; ++k) {
                            triangles.push(
                                scalar(view, property.type, at),
                                scalar(view, property.type, at + (k - 1) * step),
                                scalar(view, property.type, at + k * step),
                            );
                        }
                    }
                    at += length * step;
                } else {
                    const axis = 'xyz'.indexOf(property.name);
                    if (element.name === 'vertex' && axis >= 0) {
                        positions[3 * i + axis] = scalar(view, property.type, at);
                    }
                    at += sizes[property.type]!;
                }
            }
        }
    }
    return { positions, triangles: new Uint32Array(triangles) };
}

/** STL, binary or text. Corners stay unshared. */
export function readStl(bytes: ArrayBuffer): Mesh {
    const view = new DataView(bytes);
    const count = bytes.byteLength >= 84 ? view.getUint32(80, true) : -1;
    if (bytes.byteLength === 84 + 50 * count) {
        const positions = new Float32Array(9 * count);
        for (let t = 0; t < count; ++t) {
            for (let i = 0; i < 9; ++i) {
                positions[9 * t + i] = view.getFloat32(84 + 50 * t + 12 + 4 * i, true);
            }
        }
        return { positions, triangles: Uint32Array.from({ length: 3 * count }, (_, i) => i) };
    }
    const text = new TextDecoder().decode(bytes);
    if (!text.trimStart().startsWith('solid')) {
        throw new Unreadable('This STL is neither text nor whole.');
    }
    const numbers = [...text.matchAll(/vertex\s+(\S+)\s+(\S+)\s+(\S+)/g)].flatMap((m) => [m[1], m[2], m[3]].map(Number));
    return { positions: new Float32Array(numbers), triangles: Uint32Array.from({ length: numbers.length / 3 }, (_, i) => i) };
}

/** The tets of a VTU file as the server writes it: zlib blocks in base64, in place. */
export async function readVtu(bytes: ArrayBuffer): Promise<TetMesh> {
    const document = new DOMParser().parseFromString(new TextDecoder().decode(bytes), 'application/xml');
    const array = async (name: string) => {
        const element = [...document.querySelectorAll('DataArray')].find((node) => node.getAttribute('Name') === name);
        if (!element) {
            throw new Unreadable(`The tetrahedra have no ${name}.`);
        }
        return { type: element.getAttribute('type'), bytes: await inflateBlocks(element.textContent?.trim() ?? '') };
    };
    const points = await array('Points');
    const connectivity = await array('connectivity');
    const indices =
        connectivity.type === 'Int64'
            ? Uint32Array.from(new BigInt64Array(connectivity.bytes.buffer as ArrayBuffer), Number)
            : new Uint32Array(connectivity.bytes.buffer);
    const positions =
        points.type === 'Float64'
            ? Float32Array.from(new Float64Array(points.bytes.buffer))
            : new Float32Array(points.bytes.buffer);
    return { positions, tets: indices };
}

function decoded(base64: string): Uint8Array {
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) {
        bytes[i] = text.charCodeAt(i);
    }
    return bytes;
}

async function inflateBlocks(text: string): Promise<Uint8Array> {
    // A header of 64-bit words - blocks, size of a block, size of the last one, compressed sizes -
    // padded by itself, then the blocks as one text.
    const word = (bytes: Uint8Array, i: number) => Number(new DataView(bytes.buffer).getBigUint64(8 * i, true));
    const blocks = word(decoded(text.slice(0, 32)), 0);
    const headerLength = 4 * Math.ceil((8 * (3 + blocks)) / 3);
    const header = decoded(text.slice(0, headerLength));
    const body = decoded(text.slice(headerLength));
    const parts: Uint8Array[] = [];
    let at = 0;
    for (let i = 0; i < blocks; ++i) {
        const size = word(header, 3 + i);
        const stream = new Blob([body.slice(at, at + size)]).stream().pipeThrough(new DecompressionStream('deflate'));
        parts.push(new Uint8Array(await new Response(stream).arrayBuffer()));
        at += size;
    }
    const whole = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
    at = 0;
    for (const part of parts) {
        whole.set(part, at);
        at += part.length;
    }
    return whole;
}

/** A gzipped file as it was, any other as it is. */
export async function unzipped(bytes: ArrayBuffer): Promise<ArrayBuffer> {
    const head = new Uint8Array(bytes, 0, Math.min(2, bytes.byteLength));
    if (head[0] !== 0x1f || head[1] !== 0x8b) {
        return bytes;
    }
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();
}
