// Scales: red is degenerate and dark blue regular, as in the pictures of the report.

type Stop = readonly [number, number, number, number];

const qualityStops: Stop[] = [
    [0, 165, 0, 38],
    [0.4, 244, 109, 67],
    [0.7, 254, 224, 144],
    [0.88, 171, 214, 230],
    [1, 88, 146, 196],
];

const edgeStops: Stop[] = [
    [0, 94, 60, 153],
    [0.25, 178, 171, 210],
    [0.5, 240, 240, 236],
    [0.75, 253, 184, 99],
    [1, 230, 97, 1],
];

export type Measure = 'quality' | 'edge' | 'plain';

/** A colour of a scale as red, green and blue in [0, 1]. */
export function colourAt(measure: Exclude<Measure, 'plain'>, at: number): [number, number, number] {
    const stops = measure === 'quality' ? qualityStops : edgeStops;
    const value = Math.min(1, Math.max(0, at));
    let i = 1;
    while (i < stops.length - 1 && stops[i]![0] < value) {
        ++i;
    }
    const [low, high] = [stops[i - 1]!, stops[i]!];
    const share = (value - low[0]) / (high[0] - low[0]);
    return [1, 2, 3].map((n) => (low[n]! + share * (high[n]! - low[n]!)) / 255) as [number, number, number];
}

/** The scale as a style sheet's gradient. */
export function gradientOf(measure: Exclude<Measure, 'plain'>): string {
    const stops = measure === 'quality' ? qualityStops : edgeStops;
    return `linear-gradient(to right, ${stops.map(([at, r, g, b]) => `rgb(${r} ${g} ${b}) ${100 * at}%`).join(', ')})`;
}

/** The middle value: what edge lengths are compared with where no h is known. */
export function median(values: Float32Array): number {
    return values.length === 0 ? 1 : values.slice().sort()[values.length >> 1]!;
}
