import { useEffect, useRef, useState } from 'preact/hooks';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';

import type { Sample } from '../api';
import { count, number } from '../format';
import { stageName } from '../job_model';
import { colour, onThemeChange } from '../theme';

interface Line {
    label: string;
    ink: string;
    of: (sample: Sample) => number | null;
}

interface Plot {
    title: string;
    unit: string;
    isLog: boolean;
    range?: [number, number];
    /** What to say before there is anything. */
    empty?: string;
    lines: Line[];
}

/** A logarithm has no zero. */
const positive = (value: number | undefined) => (value && value > 0 ? value : null);

const plots: Plot[] = [
    {
        title: 'Residual and displacement',
        unit: 'relative to h',
        isLog: true,
        lines: [
            { label: 'residual force', ink: 'ink-1', of: (s) => positive(s.residual_force) },
            { label: 'largest step', ink: 'ink-2', of: (s) => positive(s.max_displacement) },
            { label: 'rms step', ink: 'ink-3', of: (s) => positive(s.rms_displacement) },
        ],
    },
    {
        title: 'Energy',
        unit: 'per particle',
        isLog: true,
        lines: [
            { label: 'potential', ink: 'ink-1', of: (s) => positive(s.potential_energy) },
            { label: 'kinetic', ink: 'ink-2', of: (s) => positive(s.kinetic_energy) },
        ],
    },
    {
        title: 'Particles',
        unit: 'count',
        isLog: false,
        lines: [
            { label: 'all', ink: 'ink-1', of: (s) => Number(s.particles ?? 0) || null },
            { label: 'on the surface', ink: 'ink-2', of: (s) => Number(s.surface_particles ?? 0) || null },
        ],
    },
    {
        title: 'Mesh quality',
        unit: 'radius ratio, 1 is regular',
        isLog: false,
        range: [0, 1],
        empty: 'Measured once the particles have become a mesh.',
        lines: [
            { label: 'mean', ink: 'ink-1', of: (s) => s.quality?.mean ?? null },
            { label: 'worst 1 %', ink: 'ink-2', of: (s) => s.quality?.first_percentile ?? null },
        ],
    },
];

const [residuals, energies, particles, quality] = plots as [Plot, Plot, Plot, Plot];

/** How the run converges: what one watches, beside the view. */
export function MainCurves(props: { samples: Sample[]; skipped: number }) {
    const { samples } = props;
    return (
        <section class="main-curves" aria-labelledby="curves-title">
            <div class="section-title">
                <h2 id="curves-title">Convergence</h2>
                <span class="muted">
                    {samples.length > 0 && `iteration ${count(samples.at(-1)!.iteration)}`}
                    {props.skipped > 0 && ` · ${count(props.skipped)} events left out on a slow connection`}
                </span>
            </div>
            <Curve plot={residuals} samples={samples} />
            <Curve plot={quality} samples={samples} />
        </section>
    );
}

/** The rest of it. */
export function MoreCurves(props: { samples: Sample[] }) {
    return (
        <section class="curves" aria-label="More of the convergence">
            <Curve plot={energies} samples={props.samples} />
            <Curve plot={particles} samples={props.samples} />
        </section>
    );
}

function Curve(props: { plot: Plot; samples: Sample[] }) {
    const { plot, samples } = props;
    const lines = plot.lines.map((line) => samples.map(line.of));
    const hasData = lines.some((line) => line.some((value) => value !== null));
    const last = plot.lines.map((line, i) => {
        const value = lines[i]!.findLast((entry) => entry !== null);
        return `${line.label} ${value === undefined ? '–' : number(value ?? undefined)}`;
    });
    return (
        <figure class="card curve">
            <figcaption>
                <strong>{plot.title}</strong> <small>{plot.unit}</small>
                <ul class="legend" aria-label="Newest values">
                    {plot.lines.map((line, i) => (
                        <li key={line.label}>
                            <i class={line.ink} aria-hidden="true" />
                            {last[i]}
                        </li>
                    ))}
                </ul>
            </figcaption>
            {hasData ? (
                <Canvas plot={plot} x={samples.map((sample) => sample.iteration)} lines={lines} />
            ) : (
                <p class="nothing plot-space">{plot.empty ?? 'Nothing yet.'}</p>
            )}
            <SampleTable plot={plot} samples={samples} />
        </figure>
    );
}

const height = 180;

function Canvas(props: { plot: Plot; x: number[]; lines: (number | null)[][] }) {
    const place = useRef<HTMLDivElement>(null);
    const chart = useRef<uPlot | null>(null);
    const [look, setLook] = useState(0);
    useEffect(() => onThemeChange(() => setLook((n) => n + 1)), []);
    useEffect(() => {
        const element = place.current!;
        chart.current = new uPlot(optionsOf(props.plot, element.clientWidth), [[], ...props.lines.map(() => [])], element);
        const observer = new ResizeObserver(() => chart.current?.setSize({ width: element.clientWidth, height }));
        observer.observe(element);
        return () => {
            observer.disconnect();
            chart.current?.destroy();
            chart.current = null;
        };
    }, [props.plot, look]);
    useEffect(() => chart.current?.setData([props.x, ...props.lines] as uPlot.AlignedData), [props.x, props.lines, look]);
    return <div ref={place} class="canvas" aria-hidden="true" />;
}

function optionsOf(plot: Plot, width: number): uPlot.Options {
    const axis: uPlot.Axis = {
        stroke: colour('muted'),
        font: '11px system-ui, sans-serif',
        grid: { stroke: colour('line'), width: 1 },
        ticks: { show: false },
    };
    const powers = (_u: uPlot, ticks: number[]) => ticks.map((tick) => (exponent(tick) ? tick : null));
    return {
        width,
        height,
        legend: { show: false },
        cursor: { points: { size: 6 }, y: false, drag: { x: true, y: false } },
        padding: [8, 8, 0, 0],
        scales: {
            x: { time: false },
            y: plot.isLog ? { distr: 3 } : plot.range ? { range: plot.range } : { range: (_u, _low, high) => [0, high * 1.1 || 1] },
        },
        axes: [
            { ...axis, size: 26 },
            {
                ...axis,
                ...(plot.isLog ? { filter: powers, grid: { ...axis.grid, filter: powers } } : {}),
                size: 52,
                values: (_u, ticks) =>
                    ticks.map((tick) => (tick === null ? '' : plot.isLog ? exponent(tick) : compact(tick))),
            },
        ],
        series: [
            {},
            ...plot.lines.map(
                (line): uPlot.Series => ({
                    label: line.label,
                    stroke: colour(line.ink),
                    width: 1.75,
                    spanGaps: true,
                    points: { show: plot.title === 'Mesh quality', size: 4 },
                }),
            ),
        ],
    };
}

function exponent(value: number): string {
    const power = Math.log10(value);
    return Math.abs(power - Math.round(power)) < 1e-6 ? `1e${Math.round(power)}` : '';
}

function compact(value: number): string {
    return value.toLocaleString('en-US', { notation: 'compact', maximumSignificantDigits: 3 });
}

const longestTable = 100;

/** The same as numbers, thinned out evenly if there are many. */
function SampleTable(props: { plot: Plot; samples: Sample[] }) {
    const [isOpen, setOpen] = useState(false);
    const stride = Math.ceil(props.samples.length / longestTable);
    const rows = isOpen ? props.samples.filter((_, i) => i % stride === 0 || i === props.samples.length - 1) : [];
    return (
        <details class="as-table" onToggle={(event) => setOpen(event.currentTarget.open)}>
            <summary>
                As a table<span class="sr">: {props.plot.title}</span>
            </summary>
            <div class="scroll" tabIndex={0} role="group" aria-label={`Table: ${props.plot.title}`}>
                <table>
                    <thead>
                        <tr>
                            <th scope="col">Iteration</th>
                            <th scope="col">Stage</th>
                            {props.plot.lines.map((line) => (
                                <th key={line.label} scope="col" class="right">
                                    {line.label}
                                </th>
                            ))}
                        </tr>
                    </thead>
                    <tbody>
                        {rows.map((sample) => (
                            <tr key={sample.iteration}>
                                <td>{sample.iteration}</td>
                                <td>{stageName(sample.stage).toLowerCase()}</td>
                                {props.plot.lines.map((line) => (
                                    <td key={line.label} class="right">
                                        {number(line.of(sample) ?? undefined)}
                                    </td>
                                ))}
                            </tr>
                        ))}
                    </tbody>
                </table>
            </div>
        </details>
    );
}
